"""A sensor that stands still for a while."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, Memory, parameter


@dataclasses.dataclass(frozen=True)
class Freeze(Behaviour):
    """Holds the last value from ``time`` on for ``duration`` seconds.

    The memory is the value shown last.
    """

    effect: ClassVar[str] = "freeze"
    places: ClassVar[tuple[str, ...]] = ("sensor",)
    in_values: ClassVar[bool] = True
    not_searched: ClassVar[str] = "the values of PV show it, which are looked at first"

    onset: float = parameter("time", "s", "time since the first sample at which it freezes")
    duration: float = parameter("duration", "s", "how long it stands still", low=0.0)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        assert isinstance(memory, float | int)
        shown = float(memory) if 0.0 <= time - self.onset < self.duration else value
        return shown, shown
