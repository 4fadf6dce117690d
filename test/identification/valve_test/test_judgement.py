"""Verdicts on simulated tests."""

import numpy as np
import pytest
from manual_tests import answer, path

from stiction_ros.identification.valve_test.frictions import Frictions
from stiction_ros.identification.valve_test.judgement import Judgement, judged
from stiction_ros.identification.valve_test.search import START, Trial
from stiction_ros.identification.valve_test.steps import Steps

OP = path()


@pytest.fixture(scope="module")
def sticky() -> Judgement:
    return judged(OP, answer(OP, (2.0, 0.8), seed=1))


def test_a_sticky_valve_is_found(sticky: Judgement) -> None:
    assert sticky.verdict.value == "sticky"
    assert sticky.probability > 0.99
    assert sticky.responded
    assert sticky.moves_seen == 7
    assert sticky.f_s_interval[0] <= 2.0 <= sticky.f_s_interval[1]
    assert sticky.f_d_interval[0] <= 0.8 <= sticky.f_d_interval[1]


def test_units_and_offsets_of_pv_change_nothing(sticky: Judgement) -> None:
    again = judged(OP, -40.0 * answer(OP, (2.0, 0.8), seed=1) + 7.0)
    assert np.isclose(again.probability, sticky.probability, atol=1e-3)
    np.testing.assert_allclose(again.f_s_interval, sticky.f_s_interval, rtol=0.1)


def test_an_ideal_valve_is_healthy() -> None:
    found = judged(OP, answer(OP, None, seed=2))
    assert found.verdict.value == "healthy"
    assert found.probability < 0.05


def test_a_level_is_judged_as_such() -> None:
    pv = answer(OP, (2.0, 0.8), seed=3, integrates=True)
    found = judged(OP, pv)
    assert found.verdict.value == "sticky"
    assert found.f_s_interval[0] <= 2.0 <= found.f_s_interval[1]


def test_pv_that_op_does_not_move_decides_nothing() -> None:
    found = judged(OP, answer(OP, None, seed=4, gain=0.0))
    assert found.verdict.value == "undecided"
    assert not found.responded


def test_the_evidence_is_smooth_where_pv_shows_a_single_slip() -> None:
    op = path((0.4, 0.0), hold=10)
    pv = answer(op, (0.35, 0.1), seed=5, integrates=True)
    trial = Trial(pv, np.ones(len(pv), dtype=bool), Steps.of(op), 1.0)
    cells = Frictions.all(trial.steps)
    near = (START._replace(lag=START.lag + away) for away in np.linspace(0.0, 0.01, 11))
    evidence = [trial.at(dynamics, cells).evidence for dynamics in near]
    assert np.abs(np.diff(evidence)).max() < 0.02
