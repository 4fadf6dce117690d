"""Which option to try first, from the mapping of ``gain --json``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

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
        if name is not None and then is not None and then <= 0.9 * now:
            told.append(f"{name} promises {100.0 * (1.0 - then / now):.0f} %")
    if not told:
        return "What to do first: as stiction identify says; no option here promises 10 % less."
    return f"What to do first, by the mean |PV−SP| that goes away: {', then '.join(told)}."
