"""A valve whose flow is not proportional to its travel."""

import dataclasses
import math
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, Start, parameter
from stiction_ros.effects.seen import Seen

_STRAIGHT = 1e-6


@dataclasses.dataclass(frozen=True)
class Characteristic(Behaviour):
    r"""The installed characteristic, curved between 0 and 100 %, without memory.

    .. math::
        \chi = 100 \, \frac{e^{c u / 100} - 1}{e^c - 1}

    c = 0 is straight, c > 0 opens slowly first, as an equal-percentage valve of
    rangeability R = e^c, c < 0 opens quickly first. The curve goes on beyond 0 and 100 %;
    it takes OP in absolute per cent.
    """

    effect: ClassVar[str] = "characteristic"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    experiment: ClassVar[str] = (
        "hold the set-point at levels for which OP differs by tens of per cent"
    )
    separation: ClassVar[str] = "hold the set-point at three levels of OP, tens of per cent apart"
    least: ClassVar[float] = 0.15
    bends: ClassVar[bool] = True

    curve: float = parameter("curve", "1", "curvature c", low=-6.0, high=6.0)

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (1.0,)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        if abs(self.curve) < _STRAIGHT:
            return memory, value
        return memory, 100.0 * math.expm1(self.curve * value / 100.0) / math.expm1(self.curve)

    @classmethod
    def simulate_grid(
        cls, grid: FloatArray, values: FloatArray, start: Start, sample_time: float = 1.0
    ) -> FloatArray:
        straight = np.abs(grid[:, 0]) < _STRAIGHT
        curve = np.where(straight, 1.0, grid[:, 0])
        curved = 100.0 * np.expm1(values[:, None] * (curve / 100.0)) / np.expm1(curve)
        return np.where(straight, values[:, None], curved)
