"""What options may be, as words.

The modules that give these words their meaning load slowly, and a mistyped option should be told
at once; test/cli/test_choices.py holds both together.
"""

from __future__ import annotations

from stiction_ros.effects import BEHAVIOURS

METHODS = ("exact", "evidence", "nlp", "grid")
LINEAR_KINDS = ("arx", "armax", "state_space")
CRITERIA = ("aic", "bic")
SUBSPACE_METHODS = ("n4sid", "moesp", "cva", "predictor")

NOISES = ("measurement", "equation")
"""Where noise enters Example 1."""

PLANTS = ("linear", "tank")
"""Plants of Example 2."""

HEALTHY = ("tight", "sine", "coloured")
"""Why a loop without friction oscillates."""

PRESETS = ("own", "corrected", "printed")
WARM_STARTS = ("compensation", "search")
SCHEDULES = ("held-out", "scenario")
BLIND_FAMILIES = ("single", "two", "outside", "physics")

CONTROL_CASES = (
    "nominal",
    "own_weights",
    "both_20_low",
    "both_20_high",
    "low_and_high",
    "high_and_low",
    "true_50_more",
    "known_50_more",
    "C_B",
    "T_A",
    "F_B",
    "two_valves",
)
"""What is not as known in ``study-control``."""

MANY = 6
"""Slips from which on a valve of the field has many."""


def laws() -> tuple[str, ...]:
    """Return the friction laws that can be identified: all but the paper's smoothed ones."""
    names = [str(kind.law) for kind in BEHAVIOURS if kind.effect == "stiction"]
    return tuple(name for name in names if not name.endswith("_smoothed"))
