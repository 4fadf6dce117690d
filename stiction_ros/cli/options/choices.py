"""What options may be, as words.

The modules that give these words their meaning load slowly, and a mistyped option should be told
at once; test/cli/options/test_choices.py holds both together.
"""

from __future__ import annotations

from stiction_ros.effects import Stiction, behaviours

LOOP_KINDS = ("flow", "pressure", "level", "temperature", "analyser")
PAPER_METHODS = ("nlp", "nlp_printed", "grid")
METHODS = ("exact", "evidence", *PAPER_METHODS)
LINEAR_KINDS = ("arx", "armax", "state_space")
CRITERIA = ("aic", "bic")
SUBSPACE_METHODS = ("n4sid", "moesp", "cva", "predictor")


def laws() -> tuple[str, ...]:
    """Return the friction laws that can be identified: all but the paper's smoothed ones."""
    kinds = [kind for kind in behaviours() if issubclass(kind, Stiction)]
    return tuple(kind.law for kind in kinds if kind.law and not kind.not_identified)
