"""Figures in words, alike on all pages."""

from __future__ import annotations

import math

CAUSES = {
    "valve": "its valve",
    "tuning": "its tuning",
    "disturbance": "a wave from outside",
    "set_point": "its set-point",
    "none": "",
    "unknown": "not explained",
}


def figure(value: float | None, digits: int = 3) -> str:
    """Return a figure with significant digits; nothing where there is none."""
    if value is None or not math.isfinite(value):
        return ""
    if abs(value) >= 10**digits:
        return f"{value:.0f}".replace("-", "−")
    return f"{value:.{digits}g}".replace("-", "−")


def percent(share: float | None) -> str:
    """Return a share as whole percent; nothing where there is none."""
    return "" if share is None or not math.isfinite(share) else f"{100.0 * share:.0f} %"


def period(seconds: float | None) -> str:
    """Return a time as people say it; nothing where there is none."""
    if seconds is None or not math.isfinite(seconds):
        return ""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"


def interval(ends: tuple[float, float] | None) -> str:
    """Return both ends; nothing where there are none."""
    return "" if ends is None else f"{figure(ends[0])} … {figure(ends[1])}"
