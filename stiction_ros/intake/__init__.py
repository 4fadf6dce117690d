"""From the exports of a historian to the records of loops."""

from stiction_ros.intake.intake import loops, one_loop
from stiction_ros.intake.intake_options import CsvColumns, IntakeOptions
from stiction_ros.intake.loop import Loop

__all__ = ["CsvColumns", "IntakeOptions", "Loop", "loops", "one_loop"]
