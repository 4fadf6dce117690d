"""What an instrument can show: its range, and how fast what it measures can move."""

from __future__ import annotations

import dataclasses
import math


@dataclasses.dataclass(frozen=True)
class Instrument:
    """Limits of one measured output; infinite where nothing is known.

    Attributes:
        low, high: range, engineering units.
        rate_limit: fastest credible change of the measurement, units per second.
    """

    low: float = -math.inf
    high: float = math.inf
    rate_limit: float = math.inf
