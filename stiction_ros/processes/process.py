"""What every process is, and the discrete linear model in deviations which it may have."""

import dataclasses
import enum
import itertools
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.signals.state_space import responses


@dataclasses.dataclass(frozen=True)
class LinearModel:
    r"""Linear dynamics about an operating point, equation (2) without the valves.

    .. math::
        \xi_{k+1} &= A \xi_k + B (\chi_k - \chi_0) + E w_k + g \\
        y_k &= C \xi_k + y_0

    Raises:
        InputError: shapes that do not fit together, or values that are not finite.
    """

    a: FloatArray  # a, b, c: shapes (n, n), (n, m), (p, n)
    b: FloatArray
    c: FloatArray
    e: FloatArray  # shape (n, d), effect of measured disturbances in deviations; d may be 0
    constant: FloatArray  # g, shape (n,), the bias of an ARX equation
    stem0: FloatArray  # stem0, pv0: the operating point χ₀ (m,) in %, y₀ (p,) in units of PV
    pv0: FloatArray

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            values = np.array(getattr(self, field.name), dtype=float)
            if not np.isfinite(values).all():
                raise InputError("a value is not finite", where=field.name)
            values.flags.writeable = False
            object.__setattr__(self, field.name, values)
        n = self.a.shape[0]
        expected = {
            "a": (n, n),
            "b": (n, self.stem0.size),
            "c": (self.pv0.size, n),
            "e": (n, self.e.shape[-1] if self.e.ndim == 2 else 0),
            "constant": (n,),
        }
        for key, shape in expected.items():
            found = getattr(self, key).shape
            if found != shape:
                raise InputError(f"shape {found} does not fit", where=key, fix=f"make it {shape}")

    @property
    def order(self) -> int:
        """Number n of states."""
        return int(self.a.shape[0])

    @property
    def gain(self) -> FloatArray:
        """Steady-state gain C (I − A)⁻¹ B, shape (p, m); inf where A integrates."""
        try:
            return np.asarray(self.c @ np.linalg.solve(np.eye(self.order) - self.a, self.b))
        except np.linalg.LinAlgError:
            return np.full((len(self.pv0), len(self.stem0)), np.inf)

    def behind_delays(self, delays: Sequence[int]) -> "LinearModel":
        """Return the model with each stem late by its delay, samples: a further state for each."""
        a, b, c, e, constant = self.a, self.b, self.c, self.e, self.constant
        for j, delay in enumerate(delays):
            for _ in range(delay):  # the stem of a sample before is one more state
                a = np.block([[a, b[:, j : j + 1]], [np.zeros((1, len(a) + 1))]])
                b = np.pad(b, ((0, 1), (0, 0)))
                b[:, j] = np.eye(len(b))[-1]
                c, e = np.pad(c, ((0, 0), (0, 1))), np.pad(e, ((0, 1), (0, 0)))
                constant = np.append(constant, 0.0)
        return LinearModel(a, b, c, e, constant, self.stem0, self.pv0)

    def step_responses(self, samples: int) -> FloatArray:
        """Return responses, (N, p, m), to stem steps of 1 % at sample 0, without ``constant``."""
        return responses(self.a, self.c, itertools.repeat(self.b, samples))


class NoiseEntry(enum.StrEnum):
    """Where white noise enters: added to PV as in (2) and (A.2), or as v in (9)."""

    MEASUREMENT = "measurement"
    EQUATION = "equation"


@dataclasses.dataclass(frozen=True)
class Noise:
    """White Gaussian noise on one output, ``std`` in the units of the output."""

    std: float = 0.0
    enters: NoiseEntry = NoiseEntry.MEASUREMENT


class Process(ABC):
    """A process with m valves, p outputs and d further inputs that nobody manipulates."""

    kind: str
    valves: tuple[str, ...]  # names of the manipulated inputs, stem positions in %
    outputs: tuple[str, ...]  # names of the outputs
    noise: tuple[Noise, ...]  # one ``Noise`` per output
    upsets: tuple[str, ...] = ()  # names of the further inputs (disturbances), measured or not
    measured_disturbances: tuple[str, ...] = ()  # those of ``upsets`` that are measured

    @abstractmethod
    def rest(self, stem: FloatArray, pv: FloatArray) -> FloatArray:
        """Return the state in which the process has rested at ``stem`` (m,) and ``pv`` (p,).

        Where the two do not belong together, ``pv`` wins for the outputs' history.
        """

    @abstractmethod
    def advance(
        self, state: FloatArray, stem: FloatArray, upset: FloatArray, noise: FloatArray
    ) -> FloatArray:
        """Return the state one sample later.

        Args:
            state: shape (n,).
            stem: stem positions during the sample, shape (m,), %.
            upset: deviations of the further inputs from nominal, shape (d,).
            noise: equation noise v of the next sample, shape (p,).
        """

    @abstractmethod
    def output(self, state: FloatArray) -> FloatArray:
        """Return the undisturbed, noise-free outputs, shape (p,)."""

    @abstractmethod
    def linear(self, sample_time: float) -> LinearModel:
        """Return the discrete linear model about the operating point."""

    def noise_std(self, entry: NoiseEntry) -> FloatArray:
        """Return the standard deviations, shape (p,), of the noise that enters there."""
        return np.array([n.std if n.enters is entry else 0.0 for n in self.noise])
