"""A valve that stands beside where OP asks it to be."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, parameter


@dataclasses.dataclass(frozen=True)
class Offset(Behaviour):
    """χ = u + size: a positioner out of calibration, without memory."""

    effect: ClassVar[str] = "offset"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    signature: ClassVar[str] = "OP and PV at rest differ from the model by a constant"
    minimum_data: ClassVar[str] = "an operating point that is known from elsewhere"
    confusable: ClassVar[tuple[str, ...]] = ("disturbance step", "sensor bias_step")

    size: float = parameter("size", "%", "stem position less OP")

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        return memory, value + self.size

    @classmethod
    def simulate_grid(
        cls,
        grid: FloatArray,
        values: FloatArray,
        start: FloatArray | float,
        sample_time: float = 1.0,
    ) -> FloatArray:
        """Return outputs, shape (N, G), for rows (size,)."""
        return values[:, None] + grid[:, 0]
