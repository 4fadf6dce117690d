"""A characteristic that follows no exponential: a curve of two figures."""

import dataclasses
import math
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, Start, parameter
from stiction_ros.effects.seen import Seen
from stiction_ros.effects.valve.characteristic import Characteristic

_SKEWED = 6.0 * math.sqrt(3.0)  # one over the largest value of x (1 − x) (1 − 2 x)


@dataclasses.dataclass(frozen=True)
class CubicCharacteristic(Behaviour):
    r"""The installed characteristic as a cubic through 0 and 100 %, without memory.

    .. math::
        \chi = u + 4 h \, x (1 - x) + 6 \sqrt{3} \, s \, x (1 - x) (1 - 2 x), \quad x = u / 100

    h is how far the curve lies above the straight line at 50 %, s how far beside that at 21 %, and
    below it at 79 %. An equal-percentage valve in a pipe that resists, or one with a plug of any
    other form, bends like that where no rangeability tells its curve. The cubic goes on beyond 0
    and 100 %.
    """

    effect: ClassVar[str] = Characteristic.effect
    law: ClassVar[str | None] = "cubic"
    places: ClassVar[tuple[str, ...]] = Characteristic.places
    experiment: ClassVar[str] = Characteristic.experiment
    separation: ClassVar[str] = Characteristic.separation
    least: ClassVar[float] = 1.9
    bends: ClassVar[bool] = True

    bend: float = parameter("bend", "%", "height above the line at 50 %", low=-50.0, high=50.0)
    skew: float = parameter("skew", "%", "height beside that at 21 %", low=-30.0, high=30.0)

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (12.0, 0.0)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        x = value / 100.0
        bow = x * (1.0 - x)
        return memory, value + bow * (4.0 * self.bend + _SKEWED * self.skew * (1.0 - 2.0 * x))

    @classmethod
    def shapes(cls, values: FloatArray) -> FloatArray:
        """Return what 1 % of either figure adds to values, shape (N,), as shape (N, 2)."""
        x = values / 100.0
        bow = x * (1.0 - x)
        return np.column_stack([4.0 * bow, _SKEWED * bow * (1.0 - 2.0 * x)])

    @classmethod
    def simulate_grid(
        cls, grid: FloatArray, values: FloatArray, start: Start, sample_time: float = 1.0
    ) -> FloatArray:
        return np.asarray(values[:, None] + cls.shapes(values) @ grid.T)
