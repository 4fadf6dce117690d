"""A valve that stops short of its ends."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import parameter
from stiction_ros.effects.limits import Limits


@dataclasses.dataclass(frozen=True)
class Saturation(Limits):
    """A stem that stops at ``low`` and ``high``, inside of what OP asks."""

    effect: ClassVar[str] = "saturation"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    experiment: ClassVar[str] = "drive OP towards the limit and hold it there until PV settles"
    bends: ClassVar[bool] = True

    low: float = parameter("low", "%", "lowest position of the stem")
    high: float = parameter("high", "%", "highest position of the stem")
