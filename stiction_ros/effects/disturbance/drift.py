"""An unmeasured disturbance, or a sensor, that drifts."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, Memory, parameter


@dataclasses.dataclass(frozen=True)
class DriftDisturbance(Behaviour):
    """Adds a ramp that starts with the first sample."""

    effect: ClassVar[str] = "drift"
    places: ClassVar[tuple[str, ...]] = ("load", "disturbance", "sensor")
    experiment: ClassVar[str] = "take a longer record"
    separation: ClassVar[str] = "compare PV with a second sensor at the start and at the end"

    rate: float = parameter("rate", "signal/s", "slope of the ramp")

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        return memory, value + self.rate * time
