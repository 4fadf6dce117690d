"""A test in manual is told from a loop in automatic by OP alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from manual_tests import path

from stiction_ros.identification.valve_test.steps import SHORTEST, Steps


def test_pairs_of_moves_are_a_test() -> None:
    steps = Steps.of(path())
    assert steps.refusal() == ""
    assert steps.holds.tolist() == [12] * 8
    assert steps.levels[:3].tolist() == [50.0, 50.5, 49.5]


@given(st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_a_controller_that_is_not_rounded_is_none(seed: int, scan: int) -> None:
    op = np.repeat(np.random.default_rng(seed).standard_normal(60).cumsum(), scan)
    assert Steps.of(op).refusal()


@given(st.integers(0, 2**32 - 1))
def test_a_rounded_controller_is_none(seed: int) -> None:
    walk = np.random.default_rng(seed).standard_normal(2000).cumsum()
    assert Steps.of(np.round(walk / 10.0)).refusal()


@pytest.mark.parametrize(
    ("op", "told"),
    [
        (np.full(100, 50.0), "makes 0 steps"),
        (path(hold=SHORTEST - 1), "rests for 6 samples"),
        (path((1.0, 2.0, 3.0)), "never comes back"),
        (np.repeat([50.0, 51.0, 50.0, 51.0, 50.0], [9, 30, 8, 30, 9]), "differ"),
    ],
)
def test_the_refusal_says_why(op: np.ndarray, told: str) -> None:
    assert told in Steps.of(op).refusal()
