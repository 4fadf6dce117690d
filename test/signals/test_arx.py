"""What inputs alone make of an equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.signals.arx import arx_columns, driven, fitted_free_run, step_response
from stiction_ros.signals.polynomials import largest_root, recursion
from stiction_ros.signals.state_space import responses

A, B, DELAYS = np.array([-1.5, 0.56]), ([0.1, 0.05], [0.2]), (2, 0)


def inputs(seed: int, count: int = 80) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).uniform(40.0, 60.0, (2, count)))


@given(st.integers(0, 1000))
@settings(max_examples=20)
def test_a_free_run_obeys_its_equation(seed: int) -> None:
    x, past = inputs(seed), np.array([3.0, -2.0])
    y = np.concatenate([past, recursion(np.append(1.0, A), driven(B, DELAYS, x, 0.2)[2:], past)])
    columns = np.column_stack(arx_columns(y, x, DELAYS, (2, 2), 6))
    assert y[6:] == pytest.approx(columns @ [1.5, -0.56, 0.1, 0.05, 0.2, 0.0] + 0.2)
    assert fitted_free_run(A, driven(B, DELAYS, x, 0.2), y) == pytest.approx(y)


def test_inputs_rested_before_their_first_sample() -> None:
    x = [np.full(30, 50.0), np.full(30, 40.0)]
    assert driven(B, DELAYS, x, 0.2) == pytest.approx(np.full(30, 0.15 * 50.0 + 0.2 * 40.0 + 0.2))


def test_an_unstable_equation_has_no_fitted_free_run() -> None:
    assert largest_root(np.array([1.0, -1.1])) == pytest.approx(1.1)
    assert np.isinf(fitted_free_run([-1.1], np.zeros(9), np.zeros(9))).all()


def test_a_step_is_answered_after_its_delay() -> None:
    answer = step_response([-0.9], [0.1], 2, 300)
    assert answer[:5] == pytest.approx([0.0, 0.0, 0.0, 0.1, 0.19])
    assert answer[-1] == pytest.approx(1.0)
    states = responses(np.array([[0.9]]), np.ones((1, 1)), np.full((298, 1, 1), 0.1))
    assert answer[2:] == pytest.approx(states[:, 0, 0])
