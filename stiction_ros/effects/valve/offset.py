"""A valve that stands beside where OP asks it to be."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, Memory, parameter


@dataclasses.dataclass(frozen=True)
class Offset(Behaviour):
    """χ = u + size: a positioner out of calibration, without memory."""

    effect: ClassVar[str] = "offset"
    places: ClassVar[tuple[str, ...]] = ("valve",)
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
