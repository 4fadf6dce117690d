"""A sensor whose calibration jumps."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.disturbance.step import StepDisturbance


@dataclasses.dataclass(frozen=True)
class BiasStep(StepDisturbance):
    """Adds ``size`` to the measurement from ``time`` on."""

    effect: ClassVar[str] = "bias_step"
    places: ClassVar[tuple[str, ...]] = ("sensor",)
    separation: ClassVar[str] = "compare PV with a second sensor or a laboratory value"
