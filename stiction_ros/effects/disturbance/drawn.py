"""What the disturbances share that are drawn by chance."""

import dataclasses
from abc import abstractmethod
from typing import ClassVar

from stiction_ros.effects.behaviour import NO_SAMPLE, Behaviour, Memory


@dataclasses.dataclass(frozen=True)
class DrawnDisturbance(Behaviour):
    """A wave w of which nothing is expected from rest; memory: (w, time of the last sample)."""

    places: ClassVar[tuple[str, ...]] = ("load", "disturbance")

    def rest(self, value: float) -> Memory:
        return (0.0, NO_SAMPLE)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        return self.step_with(memory, value, time, 0.0)

    @abstractmethod
    def step_with(
        self, memory: Memory, value: float, time: float, normal: float
    ) -> tuple[Memory, float]:
        """Advance one sample with ``normal`` drawn from N(0, 1)."""
