"""Where simulation and data disagree: find it, name it, add it, show that it shrinks."""

from stiction_ros.discrepancy.answer.found_effects import FoundEffect
from stiction_ros.discrepancy.answer.results import Discrepancy, Look
from stiction_ros.discrepancy.decision.decide import GapVerdict
from stiction_ros.discrepancy.gap_options import GapOptions
from stiction_ros.discrepancy.workflow import find_discrepancy

__all__ = ["Discrepancy", "FoundEffect", "GapOptions", "GapVerdict", "Look", "find_discrepancy"]
