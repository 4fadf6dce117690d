"""The compiled rows against what they are by definition."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.identification.valve_test.likelihood import Shape, white_rows

ROWS = 40


@settings(max_examples=15)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.5, 50.0),
    st.floats(0.0, 2.0),
    st.floats(0.0, 0.95),
    st.floats(0.01, 5.0),
)
def test_white_rows_are_those_of_the_covariance(
    seed: int, lag: float, load: float, kept: float, variance: float
) -> None:
    random = np.random.default_rng(seed)
    seen = random.random(ROWS) < 0.8
    seen[0] = True
    pole = np.exp(-1.0 / lag)
    step = np.array([[pole, 1.0 - pole, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, kept]])
    driven = np.diag([0.0, load, (1.0 - kept**2) * variance])
    shown = np.array([1.0, 0.0, 1.0])
    now, whole = np.diag([0.0, 0.0, variance]), np.eye(ROWS)
    for i in range(ROWS):
        ahead = now
        for j in range(i, ROWS):
            whole[i, j] += shown @ ahead @ shown
            whole[j, i] = whole[i, j]
            ahead = step @ ahead
        now = step @ now @ step.T + driven
    values = random.standard_normal((ROWS, 3))
    white, logarithms = white_rows(values, seen, lag, load, np.array([kept, variance]))
    root = np.linalg.cholesky(whole[np.ix_(seen, seen)])
    np.testing.assert_allclose(white, np.linalg.solve(root, values[seen]), atol=1e-8)
    np.testing.assert_allclose(logarithms, np.log(np.diag(root)).sum(), atol=1e-8)


def test_a_step_is_answered_after_its_dead_time_and_in_full() -> None:
    rows = np.array([5, 20])
    answers = Shape(8.0, 2.0, 3.0, 0.0, np.zeros(2)).answers(rows, 200)
    assert not answers[:9, 0].any()
    assert not answers[:24, 1].any()
    np.testing.assert_allclose(answers[-1], 1.0, atol=1e-6)
    np.testing.assert_allclose(answers[15:, 1], answers[:-15, 0])
