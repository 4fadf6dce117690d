"""A process that is slower than its model."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.valve.lag import Lag


@dataclasses.dataclass(frozen=True)
class ExtraPole(Lag):
    """A process that is slower by one more :class:`Lag`, which acts on its output."""

    effect: ClassVar[str] = "pole"
    places: ClassVar[tuple[str, ...]] = ("process",)
