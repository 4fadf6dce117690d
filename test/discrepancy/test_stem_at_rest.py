"""Where a stem stands before the first sample."""

import numpy as np
import pytest
from gap_loops import loop, record

from stiction_ros.discrepancy import GapOptions, find_discrepancy
from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.decision.scores import all_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.loop import LoopModel
from stiction_studies.blind.scores.world_scores import claims_of
from stiction_studies.field.hidden import hidden_loop


@pytest.mark.parametrize(
    ("law", "point", "off"),
    [(None, (3.0, -1.0), -1.5), (None, (3.0, 1.0), 1.5), ("he", (2.0, 0.5, 1.0), 1.96)],
)
def test_a_stem_may_stand_at_the_edge_of_a_deadband_and_short_of_a_slip(
    law: str | None, point: tuple[float, ...], off: float
) -> None:
    run = FreeRun(loop(), open_gate(loop(), [record(loop(), samples=300)])[0])
    effect = "backlash" if law is None else "stiction"
    (candidate,) = (
        each
        for each in all_candidates(Baseline.of(run))
        if isinstance(each, ValveCandidate) and (each.effect, each.law) == (effect, law)
    )
    first = float(run.runs.op[0, 0])
    points = np.array([point])
    assert candidate.lead(points)[0] == pytest.approx(off)
    assert candidate.stems(run, points)[0, 0] == pytest.approx(first + off, abs=1e-6)


@pytest.mark.trial
def test_backlash_that_rests_at_its_edge_is_no_stiction() -> None:
    hidden = hidden_loop(698023, "two", "exact")
    given = LoopModel.from_mapping(hidden.given)
    answer = find_discrepancy(given, [hidden.record], GapOptions(quick=True)).to_dict()
    assert any(("valve:V1", "backlash") in claim.names for claim in claims_of(answer))
