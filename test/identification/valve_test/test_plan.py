"""Rounds of a test: their size, their order and their limits."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from manual_tests import answer, path

from stiction_ros.identification.valve_test.facts import noise_over
from stiction_ros.identification.valve_test.frictions import SMALLEST
from stiction_ros.identification.valve_test.judgement import Judgement, judged
from stiction_ros.identification.valve_test.plan import (
    Facts,
    Forecast,
    Plan,
    first_round,
    further_round,
)

FACTS = Facts("V1", 50.0, 100.0, 0.8, 0.01, 3.0, 20.0, 10.0, (92.0, 108.0))


def ways(plan: Plan) -> np.ndarray:
    return np.array(plan.levels) - plan.facts.op


@pytest.fixture(scope="module")
def answered() -> Judgement:
    return judged(path(), answer(path(), (2.0, 0.8), seed=1))


@pytest.fixture(scope="module")
def unanswered() -> Judgement:
    return judged(path(), answer(path(), None, seed=4, gain=0.0), 0.8)


def test_the_first_round_widens_from_the_smallest_friction_of_interest() -> None:
    plan = first_round(FACTS)
    assert np.allclose(ways(plan), [0.4, -0.4, 1.0, -1.0, 2.5, -2.5, 0.0])
    assert plan.duration == 140.0
    assert plan.pv_move == pytest.approx(2.0)


def test_a_noisy_pv_takes_larger_pairs() -> None:
    plan = first_round(dataclasses.replace(FACTS, noise=1.0))
    assert ways(plan)[0] == pytest.approx(2.5)


@pytest.mark.parametrize("kept", [0.0, 0.9])
def test_the_noise_of_a_hold_is_that_of_its_mean_however_it_is_coloured(kept: float) -> None:
    noise = np.random.default_rng(1).standard_normal(100_000)
    for row in range(1, len(noise)):
        noise[row] = kept * noise[row - 1] + np.sqrt(1.0 - kept**2) * noise[row]
    holds = noise[: len(noise) // 24 * 24].reshape(-1, 2, 12).mean(axis=2)
    drift = np.linspace(0.0, 30.0, len(noise))
    told = np.diff(holds, axis=1).std() / np.sqrt(2.0)
    assert noise_over(noise + drift, 12) == pytest.approx(told, rel=0.05)
    assert noise_over(np.zeros(1), 12) == 0.0


@given(st.floats(-2.0, 2.0), st.floats(0.0, 1.0), st.floats(0.1, 30.0), st.floats(0.1, 50.0))
def test_the_first_round_passes_no_limit_and_comes_back(
    gain: float, noise: float, op_limit: float, room: float
) -> None:
    limits = (100.0 - room, 100.0 + 2.0 * room)
    plan = first_round(
        dataclasses.replace(
            FACTS, gain=gain or None, noise=noise, op_limit=op_limit, pv_limit=limits
        )
    )
    assert plan.levels[-1] == FACTS.op
    assert np.isclose(ways(plan).sum(), 0.0)  # a level is left where it was
    assert plan.reach <= op_limit * (1.0 + 1e-9)
    assert plan.pv_move is None or plan.pv_move <= room * (1.0 + 1e-9)


def test_where_pv_does_not_answer_the_pairs_widen_until_the_limits_end_the_test(
    unanswered: Judgement,
) -> None:
    wider = further_round(FACTS, unanswered)
    assert wider is not None
    assert ways(wider)[0] == pytest.approx(7.5)
    assert further_round(dataclasses.replace(FACTS, op_limit=3.0), unanswered) is None


def test_a_further_round_keeps_pv_within_its_limits(answered: Judgement) -> None:
    free = further_round(FACTS, answered, 1)
    assert free is not None
    close = dataclasses.replace(FACTS, pv_limit=(98.5, 101.5))
    bound = further_round(close, answered, 1)
    assert bound is None or bound.reach <= min(free.reach, 4.0)


def test_the_forecast_of_an_ideal_valve_goes_with_op(answered: Judgement) -> None:
    ahead = Forecast.of(answered, (51.0, 49.0))
    assert ahead.pv[0, 0] > ahead.pv[0, 1]
    assert ahead.weights.sum() == pytest.approx(1.0, abs=0.01)
    assert ahead.beyond(-1e9, 1e9) == 0.0
    assert ahead.beyond(0.0, 1.0) == pytest.approx(1.0, abs=0.01)


def test_the_mapping_has_the_keys_of_the_contract() -> None:
    told = first_round(FACTS).to_dict()
    assert list(told) == [
        *("valve", "start", "moves", "duration", "pv_limit", "return_op", "expected", "sentence")
    ]
    assert told["moves"][1] == {"after": 20.0, "op": 49.6}
    assert told["expected"] == {"pv_move": pytest.approx(2.0), "decides_above": SMALLEST}
    assert "return it to 50 %" in told["sentence"]
