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
    confusable: ClassVar[tuple[str, ...]] = ("load step", "disturbance step", "sensor bias_step")
    experiment: ClassVar[str] = (
        "measure the stem: a constant offset is taken up by the operating point"
    )
    separation: ClassVar[str] = (
        "record the stem position: an offset of the valve shows there, a load does not"
    )
    not_searched: ClassVar[str] = "the operating point takes it up"

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
