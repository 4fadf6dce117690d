"""Rounds of a test: their size, their order and their limits."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.identification.valve_test.frictions import SMALLEST
from stiction_ros.identification.valve_test.plan import Facts, Plan, first_round, further_round

FACTS = Facts("V1", 50.0, 100.0, 0.8, 0.01, 20.0, 10.0, (92.0, 108.0))


def ways(plan: Plan) -> np.ndarray:
    return np.array(plan.levels) - plan.facts.op


def seen(reach: float, responded: bool, gain: float = 0.8) -> Any:
    steps = SimpleNamespace(levels=np.array([50.0, 50.0 + reach, 50.0 - reach, 50.0]))
    trial = SimpleNamespace(steps=steps)
    return SimpleNamespace(trial=trial, responded=responded, gain=gain)


def test_the_first_round_widens_from_the_smallest_friction_of_interest() -> None:
    plan = first_round(FACTS)
    assert np.allclose(ways(plan), [0.4, -0.4, 1.0, -1.0, 2.5, -2.5, 0.0])
    assert plan.duration == 140.0
    assert plan.pv_move == pytest.approx(2.0)


def test_a_noisy_pv_takes_larger_pairs() -> None:
    plan = first_round(dataclasses.replace(FACTS, noise=1.0))
    assert ways(plan)[0] == pytest.approx(2.5)


@settings(deadline=None)
@given(
    st.floats(-2.0, 2.0),
    st.floats(0.0, 1.0),
    st.floats(0.1, 30.0),
    st.floats(0.1, 50.0),
    st.booleans(),
)
def test_no_round_passes_a_limit_and_each_comes_back(
    gain: float, noise: float, op_limit: float, room: float, responded: bool
) -> None:
    limits = (100.0 - room, 100.0 + 2.0 * room)
    facts = dataclasses.replace(
        FACTS, gain=gain or None, noise=noise, op_limit=op_limit, pv_limit=limits
    )
    plan: Plan | None = first_round(facts)
    for _ in range(4):
        if plan is None:
            break
        assert plan.levels[-1] == facts.op
        assert np.isclose(ways(plan).sum(), 0.0)  # a level is left where it was
        assert plan.reach <= op_limit * (1.0 + 1e-9)
        assert plan.pv_move is None or plan.pv_move <= room * (1.0 + 1e-9)
        plan = further_round(facts, seen(plan.reach, responded, gain))


def test_where_pv_does_not_answer_the_limits_end_the_test() -> None:
    assert further_round(FACTS, seen(FACTS.widest, responded=False)) is None
    wider = further_round(FACTS, seen(2.5, responded=False))
    assert wider is not None
    assert ways(wider)[0] == pytest.approx(6.25)


def test_where_pv_answers_the_gain_is_that_of_the_test() -> None:
    again = further_round(FACTS, seen(2.5, responded=True, gain=-4.0))
    assert again is not None
    assert np.allclose(ways(again), [1.0, -1.0, 2.0, -2.0, 0.0])  # PV may go by 8


def test_the_mapping_has_the_keys_of_the_contract() -> None:
    told = first_round(FACTS).to_json()
    assert list(told) == [
        *("valve", "start", "moves", "duration", "pv_limit", "return_op", "expected", "sentence"),
    ]
    assert told["moves"][1] == {"after": 20.0, "op": 49.6}
    assert told["expected"] == {"pv_move": pytest.approx(2.0), "decides_above": SMALLEST}
    assert "return it to 50 %" in told["sentence"]
