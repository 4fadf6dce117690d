"""A sensor that stands still for a while."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, Memory, parameter


@dataclasses.dataclass(frozen=True)
class Freeze(Behaviour):
    """Holds the last value from ``time`` on for ``duration`` seconds.

    The memory is the value shown last.

    Raises:
        InputError: a negative duration, or a value that is not finite.
    """

    effect: ClassVar[str] = "freeze"
    places: ClassVar[tuple[str, ...]] = ("sensor",)
    signature: ClassVar[str] = "PV rests at exactly one value, without noise, for one while"
    minimum_data: ClassVar[str] = "noise on PV, so that standing still is seen"
    confusable: ClassVar[tuple[str, ...]] = ("sensor clip", "sensor quantisation")
    in_values: ClassVar[bool] = True
    not_searched: ClassVar[str] = "the values of PV show it, which are looked at first"

    onset: float = parameter("time", "s", "time since the first sample at which it freezes")
    duration: float = parameter("duration", "s", "how long it stands still", low=0.0)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        """Return the value shown twice, as memory and as output."""
        assert isinstance(memory, float | int)
        shown = float(memory) if 0.0 <= time - self.onset < self.duration else value
        return shown, shown
