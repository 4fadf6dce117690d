"""The controller that a record shows: what it is recovered from, and what was found."""

import dataclasses
import enum

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

Stretches = list[tuple[int, int]]


class ControllerStatus(enum.StrEnum):
    """Whether a controller was recovered."""

    OK = "ok"
    NO_MOVES = "no_moves"
    NO_RELATION = "no_relation"


@dataclasses.dataclass(frozen=True)
class RecoveredController:
    """A PI(D) controller in velocity form, all times in samples."""

    status: ControllerStatus  # ok, or why there is none
    reason: str  # one sentence; empty when ok
    set_point: FloatArray  # as recorded or found, shape (N,)
    # where OP was seen to rest while the controller would have gone on; infinite where it was not
    limits: tuple[float, float]
    # (K, K_i, K_d), OP per unit of PV and sample, signed for e = SP − PV, shape (3,)
    coefficients: FloatArray = dataclasses.field(default_factory=lambda: np.zeros(3))
    # of the coefficients from a jackknife over blocks, shape (3, 3)
    covariance: FloatArray = dataclasses.field(default_factory=lambda: np.zeros((3, 3)))
    lag: int = 0  # samples between PV and the OP that answers it
    smoothing: float = 0.0  # share of the last value in the filter of the error
    span: int = 1  # h, samples
    r_squared: float = 0.0  # share of the moves of OP over h samples that is explained

    @property
    def gain(self) -> float:
        """K, OP per unit of PV."""
        return float(self.coefficients[0])

    @property
    def integral_time(self) -> float:
        """T_i = K / K_i, samples; infinite without reset."""
        if self.coefficients[1] == 0.0:
            return float("inf")
        return float(self.coefficients[0] / self.coefficients[1])
