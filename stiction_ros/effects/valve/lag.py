"""A first-order lag, of a valve or of a sensor."""

import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import (
    NO_SAMPLE,
    Behaviour,
    Filter,
    FloatArray,
    Memory,
    elapsed,
    parameter,
)
from stiction_ros.effects.seen import Seen


@dataclasses.dataclass(frozen=True)
class Lag(Behaviour):
    r"""The signal follows with a time constant.

    .. math::
        y_k = \alpha y_{k-1} + (1 - \alpha) x_k, \quad \alpha = e^{-T_s/\tau}

    The memory is (y, time of the last sample). At the first sample no time has passed, so
    the signal is where it rested. τ = 0 leaves the signal as it is.
    """

    effect: ClassVar[str] = "lag"
    places: ClassVar[tuple[str, ...]] = ("valve", "sensor")
    experiment: ClassVar[str] = "move the set-point in steps"
    separation: ClassVar[str] = (
        "record the stem position: a slow valve shows there; move the sensor or compare it with "
        "a second one to tell a slow sensor from a slow process"
    )
    family: ClassVar[str] = "lag"
    absorbed: ClassVar[bool] = True
    kernel: ClassVar[str] = "lagged"

    time_constant: float = parameter("tau", "s", "time constant τ", low=0.0)

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (3.0 * seen.sample_time,)

    def rest(self, value: float) -> Memory:
        return (value, NO_SAMPLE)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        last, before = memory
        share = -math.expm1(-_ratio(elapsed(before, time), self.time_constant))
        out = value if share == 1.0 else last + share * (value - last)
        return (out, time), out

    @classmethod
    def kernel_figures(cls, grid: FloatArray, sample_time: float) -> Sequence[FloatArray]:
        return [np.array([-math.expm1(-_ratio(sample_time, tau)) for tau in grid[:, 0].tolist()])]

    def filter(self, sample_time: float) -> Filter:
        """Return the lag with z_k = y_{k−1}."""
        alpha = math.exp(-_ratio(sample_time, self.time_constant))
        return Filter(np.array([[alpha]]), np.array([1.0 - alpha]), np.array([alpha]), 1.0 - alpha)


def _ratio(elapsed_time: float, time_constant: float) -> float:
    """Return T/τ; a lag without a time constant forgets whatever time has passed."""
    if elapsed_time == 0.0:
        return 0.0
    return elapsed_time / time_constant if time_constant > 0.0 else math.inf
