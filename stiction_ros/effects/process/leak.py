"""Leak: a process that loses a share of what it has gathered."""

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
class Leak(Behaviour):
    r"""A loss in proportion to the output's deviation y from its operating point.

    .. math::
        \dot y = \dot x - \lambda y, \quad y_k = e^{-\lambda T_s} y_{k-1} + x_k - x_{k-1}

    x is the output of the process without the leak. An integrating process K/s becomes
    K/(s + λ), exactly; a slow one with a time constant well above 1/λ nearly so. A process
    that settles by itself does not leak in this way: its output would return to the
    operating point after every move.

    The memory is (y, x, time of the last sample). It rests with y = x, as if the leak began
    with the first sample.
    """

    effect: ClassVar[str] = "leak"
    places: ClassVar[tuple[str, ...]] = ("process",)
    experiment: ClassVar[str] = "move the set-point and hold it for several times the leak's time"
    absorbed: ClassVar[bool] = True
    kernel: ClassVar[str] = "leaking"

    rate: float = parameter("rate", "1/s", "share λ that is lost per second", low=0.0)

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (10.0 / seen.duration,)

    def rest(self, value: float) -> Memory:
        return (value, value, NO_SAMPLE)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        last, before, at = memory
        out = math.exp(-self.rate * elapsed(at, time)) * last + (value - before)
        return (out, value, time), out

    @classmethod
    def kernel_figures(cls, grid: FloatArray, sample_time: float) -> Sequence[FloatArray]:
        return [np.exp(-grid[:, 0] * sample_time)]

    def filter(self, sample_time: float) -> Filter:
        """Return the leak with z_k = e^{−λT} y_{k−1} − x_{k−1}."""
        keep = math.exp(-self.rate * sample_time)
        return Filter(np.array([[keep]]), np.array([keep - 1.0]), np.array([1.0]), 1.0)
