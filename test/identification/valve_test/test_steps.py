"""A test in manual is told from a loop in automatic: there OP answers PV."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manual_tests import answer, path

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.valve_test.steps import SHORTEST, Steps

STAIR = (*range(1, 6), *range(4, -6, -1), *range(-4, 1))


def closed(seed: int, rounding: float, count: int = 800) -> tuple[FloatArray, FloatArray]:
    """Return a rounded OP and PV of a PI controller of a lag with a drifting load."""
    random = np.random.default_rng(seed)
    op, pv, command, before, state = np.empty(count), np.empty(count), 0.0, 0.0, 0.0
    load = np.cumsum(0.05 * rounding * random.standard_normal(count))
    for k in range(count):
        pv[k] = state + 0.02 * random.standard_normal()
        command += 0.4 * (before - pv[k] - pv[k] / 12.0)
        before = pv[k]
        op[k] = rounding * np.round(command / rounding)
        state += (op[k] + load[k] - state) / 6.0
    return op, pv


def test_pairs_of_moves_are_a_test() -> None:
    steps = Steps.of(path())
    assert steps.holds.tolist() == [12] * 8
    assert steps.levels[:3].tolist() == [50.0, 50.5, 49.5]


@settings(max_examples=20, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([(0.5, -0.5, 1.2, -1.2, 3.0, -3.0, 0.0), (1.0, -1.0, 2.0, -2.0, 0.0), STAIR]),
    st.sampled_from([None, (1.0, 0.3), (3.0, 1.0)]),
    st.booleans(),
)
def test_moves_of_a_plan_and_stairs_are_a_test(
    seed: int, levels: tuple[float, ...], friction: tuple[float, float] | None, integrates: bool
) -> None:
    op = path(levels, hold=20)
    pv = answer(op, friction, seed, integrates=integrates)
    assert Steps.of(op).refusal(-pv) == ""
    assert Steps.of(op).refusal(80.0 - pv) == ""


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 6.0))
def test_a_controller_is_none_however_coarsely_it_is_rounded(seed: int, rounding: float) -> None:
    op, pv = closed(seed, rounding)
    assert Steps.of(op).refusal(-pv)


def test_a_rounded_controller_is_told_by_its_answer_to_pv() -> None:
    op, pv = next(
        (op, pv)
        for op, pv in (closed(seed, 4.0) for seed in range(100))
        if len(rows := np.flatnonzero(np.diff(op))) > 5 and np.diff(rows).min() >= SHORTEST
    )
    assert "PV explains" in Steps.of(op).refusal(-pv)


@pytest.mark.parametrize(
    ("op", "told"),
    [
        (np.full(100, 50.0), "makes 0 steps"),
        (path(hold=SHORTEST - 1), "rests for 6 samples"),
    ],
)
def test_the_refusal_says_why(op: FloatArray, told: str) -> None:
    assert told in Steps.of(op).refusal(np.zeros(len(op)))
