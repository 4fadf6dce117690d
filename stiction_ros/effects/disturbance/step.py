"""An unmeasured disturbance that comes at one moment."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, Memory, parameter
from stiction_ros.effects.seen import Seen


@dataclasses.dataclass(frozen=True)
class StepDisturbance(Behaviour):
    """Adds ``size`` from ``time`` on."""

    effect: ClassVar[str] = "step"
    places: ClassVar[tuple[str, ...]] = ("load", "disturbance")
    experiment: ClassVar[str] = "take a longer record around the moment"

    onset: float = parameter("time", "s", "time of the step since the first sample")
    size: float = parameter("size", "signal", "height of the step")

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (0.5 * seen.duration,)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        return memory, value + (self.size if time >= self.onset else 0.0)
