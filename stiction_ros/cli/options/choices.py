"""What options may be, as words.

The modules that give these words their meaning load slowly, and a mistyped option should be told
at once; test/cli/options/test_choices.py holds both together.
"""

from __future__ import annotations

from stiction_ros.effects import Stiction, behaviours

LOOP_KINDS = ("flow", "pressure", "level", "temperature", "analyser")
PAPER_METHODS = ("nlp", "nlp_printed", "grid")
METHODS = ("exact", "evidence", *PAPER_METHODS)
COUNTED = METHODS
"""Methods that ``stiction paper --success`` counts."""

FIGURES = (1, 2, 3, 4, 5, 6)
TABLES = (
    "1",
    "2",
    "A.3",
    "times",
    "wells",
    "success",
    "laws",
    "retuning",
    "ablation",
    "identified",
)
"""Exhibits of the paper."""

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
WARM_STARTS = ("compensation", "search", "none")
PROGRAMME_COSTS = ("revised", "plain")
PRINTED_LAWS = ("he", "kano", "xch")
SCHEDULES = ("held-out", "scenario")
BLIND_FAMILIES = ("single", "two", "outside")
PHYSICS = "physics"
"""The family of loops of the field whose friction is by the mechanics of the stem."""

GIVEN = ("exact", "off")

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
    kinds = [kind for kind in behaviours() if issubclass(kind, Stiction)]
    return tuple(kind.law for kind in kinds if kind.law and not kind.not_identified)
