"""Where simulation and data disagree: find it, name it, add it, show that it shrinks."""

from stiction_ros.discrepancy.decide import GapVerdict
from stiction_ros.discrepancy.options import GapOptions
from stiction_ros.discrepancy.results import Discrepancy, FoundEffect, Look
from stiction_ros.discrepancy.workflow import find_discrepancy

__all__ = ["Discrepancy", "FoundEffect", "GapOptions", "GapVerdict", "Look", "find_discrepancy"]
