"""A process that answers more, or less, than the model says."""

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, Filter, FloatArray, Memory, Start, parameter


@dataclasses.dataclass(frozen=True)
class ProcessGain(Behaviour):
    """y = factor · x in deviations from the operating point, without memory."""

    effect: ClassVar[str] = "gain"
    places: ClassVar[tuple[str, ...]] = ("process",)
    experiment: ClassVar[str] = "move the set-point in steps well above the noise"
    separation: ClassVar[str] = "hold the set-point at three levels of OP, tens of per cent apart"
    absorbed: ClassVar[bool] = True

    factor: float = parameter("factor", "1", "gain over that of the model", low=0.01, high=100.0)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        return memory, self.factor * value

    @classmethod
    def simulate_grid(
        cls, grid: FloatArray, values: FloatArray, start: Start, sample_time: float = 1.0
    ) -> FloatArray:
        return values[:, None] * grid[:, 0]

    def filter(self, sample_time: float) -> Filter:
        """Return the gain; it has no state."""
        return Filter(np.zeros((0, 0)), np.zeros(0), np.zeros(0), self.factor)
