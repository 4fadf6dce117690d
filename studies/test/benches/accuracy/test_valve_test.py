"""`stiction bench valve-test`: its valves, its counting and one test."""

from typing import Any

import numpy as np
import pytest

from stiction_studies.benches.accuracy.valve_test import Ended, facts_of, groups, judge, table_row
from stiction_studies.field.manual_test import manual_test
from stiction_studies.field.truth import ValveKind


def ended(**changes: Any) -> Ended:
    values: dict[str, Any] = {
        "seed": 1,
        "kind": "sticky",
        "plant": "flow",
        "law": "he",
        "f_s": 2.0,
        "circumstances": (),
        "verdict": "sticky",
        "probability": 0.99,
        "interval": (1.0, 3.0),
        "moves": 6,
        "duration": 12.0,
        "beyond": 0.0,
        "seconds": 0.5,
        "ended": "",
    }
    return Ended(**(values | changes))


def test_a_third_is_ideal_and_moves_as_op() -> None:
    case = manual_test(2)
    assert case.kind is ValveKind.HEALTHY
    assert case.lead == case.f_s == 0.0
    assert manual_test(3).kind is ValveKind.STICKY


def test_pv_is_the_same_however_far_it_is_asked_for() -> None:
    case = manual_test(0)
    op = np.full(60, case.op)
    longer, clean = case.pv(np.append(op, np.full(40, case.op + 5.0)))
    shorter, _ = case.pv(op)
    assert np.array_equal(longer[:60], shorter)
    assert len(clean) == 100


def test_what_is_known_before_is_near_the_truth() -> None:
    case = manual_test(3)
    facts = facts_of(case)
    assert not case.settles
    samples = facts.hold / case.sample_time
    assert samples == pytest.approx(round(samples))
    assert 0.7 < facts.gain / (case.answer.gain * facts.hold) < 1.4  # type: ignore[operator]


def test_the_counts() -> None:
    rows = [
        ended(),
        ended(f_s=5.0, circumstances=("rounded",)),
        ended(verdict="healthy"),
        ended(kind="healthy", law="ideal", f_s=0.0, verdict="healthy", interval=(0.0, 0.4)),
        ended(kind="healthy", law="ideal", f_s=0.0, verdict="undecided"),
        ended(kind="healthy", law="ideal", f_s=0.0, verdict="backlash"),
    ]
    row = table_row("all", rows)
    assert (row["valves"], row["decided"], row["wrong"]) == (6, 5, 2)
    assert (row["held"], row["found"]) == (1, 2)
    assert {name: len(part) for name, part in groups(rows).items()}["with rounded"] == 1


@pytest.mark.trial
def test_a_valve_is_tested_to_the_end() -> None:
    row = judge(3)
    assert row.verdict == "sticky"
    assert row.held
