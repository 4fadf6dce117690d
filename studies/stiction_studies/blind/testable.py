"""Whether a record shows what is hidden, by the criterion of the workflow itself."""

import math

from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.decision.scores import all_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import fit_candidate
from stiction_ros.discrepancy.measures import MARGIN
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_studies.blind.loops.generator import BlindLoop
from stiction_studies.blind.loops.truth import Hidden, Truth
from stiction_studies.blind.scores.families import SHOWN_BY_DATA, Name


def gains_beyond_margin(seen: BlindLoop, truth: Truth) -> dict[Name, float]:
    """Return by how much each hidden effect, fitted, beats no effect beyond the margin, in BIC.

    Of two effects, the other one is in the model already, with its true figures. What the
    values of PV or the recorded tuning show needs no fit and counts as testable.
    """
    return {entry.name: _gain(seen, truth, entry) for entry in truth.hidden}


def _gain(seen: BlindLoop, truth: Truth, entry: Hidden) -> float:
    if entry.behaviour.effect in SHOWN_BY_DATA:
        return math.inf
    model = seen.model
    for other in truth.hidden:
        if other is not entry:
            model = model.with_effect(other.place, other.behaviour)
    runs, _ = open_gate(model, [seen.record])
    base = Baseline.of(FreeRun(model, runs))
    gap = base.run.gap
    gains = [
        fit_candidate(base, gap, candidate).evidence
        for candidate in all_candidates(base)
        if entry.name in candidate.keys
    ]
    return max(gains, default=-math.inf) - MARGIN
