"""The paper as printed: its identification methods, its figures and its tables."""

from __future__ import annotations

from stiction_ros.paper.methods import METHODS, identify
from stiction_ros.paper.options import PaperOptions

__all__ = ["METHODS", "PaperOptions", "identify"]
