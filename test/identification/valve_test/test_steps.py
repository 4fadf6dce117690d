"""A test in manual is told from a loop in automatic: there OP answers PV."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manual_tests import answer, path

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.valve_test.steps import SHORTEST, Steps

STAIR = (*range(1, 6), *range(4, -6, -1), *range(-4, 1))


def controlled(seed: int, rounding: float) -> tuple[FloatArray, FloatArray]:
    """Return PV of two waves and some noise, and OP of a PI controller that answers it, rounded."""
    random = np.random.default_rng(seed)
    time = np.arange(900)
    periods, phases = random.uniform(150.0, 400.0, 2), random.uniform(0.0, 6.0, 2)
    pv = np.sin(2.0 * np.pi * time[:, None] / periods + phases).sum(axis=1)
    pv += 0.01 * random.standard_normal(len(time))
    command = -random.uniform(0.01, 0.3) * (pv + np.cumsum(pv) / random.uniform(5.0, 40.0))
    return rounding * np.round(command / rounding), pv


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
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 2.0))
def test_a_controller_is_none_however_coarsely_it_is_rounded(seed: int, rounding: float) -> None:
    op, pv = controlled(seed, rounding)
    assert Steps.of(op).refusal(-pv)


def test_a_rounded_controller_is_told_by_its_answer_to_pv() -> None:
    told = [Steps.of(op).refusal(-pv) for op, pv in (controlled(seed, 0.5) for seed in range(20))]
    assert any("PV explains" in why for why in told)


@pytest.mark.parametrize(
    ("op", "told"),
    [(np.full(100, 50.0), "makes 0 steps"), (path(hold=SHORTEST - 1), "rests for 6 samples")],
)
def test_the_refusal_says_why(op: FloatArray, told: str) -> None:
    assert told in Steps.of(op).refusal(np.zeros(len(op)))
