"""Least squares of columns that may depend on each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.discrepancy.likelihood.least_squares import coefficients


@settings(deadline=None, max_examples=50)
@given(st.integers(1, 6), st.integers(0, 2), st.integers(0, 1000))
def test_what_is_left_is_orthogonal_to_all_columns(own: int, dependent: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    columns = 10.0 ** random.uniform(-3.0, 3.0, (own, 1)) * random.normal(size=(own, 200))
    columns = np.vstack([columns, random.normal(size=(dependent, own)) @ columns, np.zeros(200)])
    columns = random.permutation(columns)
    target = random.normal(size=200)
    left = target - coefficients(columns, target) @ columns
    lengths = np.linalg.norm(columns, axis=1)
    assert np.all(np.abs(columns @ left) <= 1e-6 * lengths * np.linalg.norm(target))


def test_columns_that_hardly_differ_are_both_found() -> None:
    random = np.random.default_rng(1)
    first, other = random.normal(size=(2, 300))
    columns = np.vstack([first, first + 1e-6 * other])
    found = coefficients(columns, columns.T @ np.array([2.0, -3.0]))
    assert found == pytest.approx([2.0, -3.0], rel=1e-6)
    assert coefficients(np.vstack([first, 2.0 * first]), first).tolist() == pytest.approx(
        [1.0, 0.0]
    )
