"""Figures in words, alike on all pages."""

import math

CAUSES = {
    "valve": "its valve",
    "tuning": "its tuning",
    "disturbance": "a wave from outside",
    "set_point": "its set-point",
    "none": "no cycle",
    "unknown": "not explained",
}
"""Cause of a cycle as people read it, wherever they do."""

PERCENT = "%"  # unit of an OP that is known; another one is the loop's own and has no name


def figure(value: float | None) -> str:
    """Return a figure with three significant digits; nothing where there is none."""
    if value is None or not math.isfinite(value):
        return ""
    if abs(value) >= 1000.0:
        return f"{value:.0f}".replace("-", "−")
    return f"{value:.3g}".replace("-", "−")


def percent(share: float | None) -> str:
    """Return a share as whole percent, at most 100; nothing where there is none."""
    return "" if share is None or not math.isfinite(share) else f"{100.0 * min(share, 1.0):.0f} %"


def signed_percent(change: float) -> str:
    """Return a change as whole percent with its sign."""
    whole = round(100.0 * change)
    return f"{whole:+d} %".replace("-", "−") if whole else "0 %"


def op_figure(value: float | None, op_unit: str) -> str:
    """Return a figure with the unit of OP behind it; nothing where there is none."""
    shown = figure(value)
    return shown and f"{shown} {'%' if op_unit == PERCENT else 'units'}"


def cause_words(cause: str | None) -> str:
    """Return what a loop cycles by; nothing where that is not known."""
    return "" if cause is None else CAUSES.get(cause, cause)


def interval(ends: tuple[float, float] | None) -> str:
    """Return both ends; nothing where there are none."""
    return "" if ends is None else f"{figure(ends[0])} … {figure(ends[1])}"
