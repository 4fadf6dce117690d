"""Which option to try first, from the mapping of ``gain --json``."""

from collections.abc import Mapping
from typing import Any

PROMISED = 0.10
"""Share of now from which on less is a promise: then each drawn loop must become better, too."""

MEASURES = {
    "amplitude": "amplitude",
    "iae_per_hour": "mean |PV−SP|",
    "travel_per_hour": "stem travel/h",
    "moves_per_hour": "stem moves/h",
    "reversals_per_hour": "stem reversals/h",
    "period": "period, s",
}
"""Measures in the order in which they are shown, and what they are called."""

NAMES = {
    "service": "a service of the valve",
    "embedding": "the controller that knows the friction (embedding)",
    "retune": "retuning the controller",
}


def advice(gain: Mapping[str, Any]) -> str:
    """Return in a sentence which option promises the least mean |PV − SP|."""
    now, told = gain["now"]["iae_per_hour"], []
    for option in sorted(gain["options"], key=lambda one: one["iae_per_hour"] or 0.0):
        then, name = option["iae_per_hour"], NAMES.get(option["what"])
        if name is not None and then is not None and then <= (1.0 - PROMISED) * now:
            told.append(f"{name} promises {100.0 * (1.0 - then / now):.0f} %")
    if not told:
        return "What to do first: as stiction identify says; no option here promises enough."
    return f"What to do first, by the mean |PV−SP| that goes away: {', then '.join(told)}."
