"""A sensor that ends before its signal does."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, parameter
from stiction_ros.effects.valve.saturation import Saturation


@dataclasses.dataclass(frozen=True)
class Clip(Saturation):
    """A sensor that shows nothing below ``low`` and above ``high``."""

    effect: ClassVar[str] = "clip"
    places: ClassVar[tuple[str, ...]] = ("sensor",)
    experiment: ClassVar[str] = Behaviour.experiment
    bends: ClassVar[bool] = False
    in_values: ClassVar[bool] = True
    not_searched: ClassVar[str] = "the values of PV show it, which are looked at first"

    low: float = parameter("low", "signal", "lower end of the sensor's range")
    high: float = parameter("high", "signal", "upper end of the sensor's range")
