"""From the exports of a historian to the records of loops."""

from stiction_ros.intake.intake import loops
from stiction_ros.intake.loop import Loop
from stiction_ros.intake.options import IntakeOptions

__all__ = ["IntakeOptions", "Loop", "loops"]
