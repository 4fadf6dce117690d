from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.identification.evidence.kernels import (
    Given,
    evidence,
    factorised,
    lagged,
    lagged_products,
    solved,
    whitened,
    with_past,
)
from stiction_ros.identification.evidence.response_prior import ResponsePrior


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(2, 12), st.integers(0, 20))
def test_products_of_lags_are_those_of_the_rows(seed: int, taps: int, first: int) -> None:
    signal, other = np.random.default_rng(seed).standard_normal((2, 60))
    rows = lagged(signal, float(signal[0]), first, taps)
    others = lagged(other, float(other[0]), first, taps)
    padded = [with_past(one, taps) for one in (signal, other)]
    found = lagged_products(padded[0], padded[1], 60 - first, taps)
    assert found == pytest.approx(rows @ others.T, abs=1e-9)


def test_lags_reach_back_before_the_record() -> None:
    rows = lagged(np.array([1.0, 2.0, 3.0]), 9.0, 0, 2)
    assert rows.tolist() == [[9.0, 1.0, 2.0], [9.0, 9.0, 1.0]]


def test_a_signal_that_was_constant_before_the_record_has_no_transient() -> None:
    noise = np.array([1.0, -0.8, 0.1])
    assert whitened(noise, np.full(9, 2.0), 2.0) == pytest.approx(np.full(9, 0.6))


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(1, 9))
def test_factor_solves_and_tells_the_determinant(seed: int, size: int) -> None:
    random = np.random.default_rng(seed)
    root = random.standard_normal((size, size + 3))
    matrix, right = root @ root.T + 0.1 * np.eye(size), random.standard_normal(size)
    factor = matrix.copy()
    assert factorised(factor) == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-8)
    solution, explained = solved(factor, right)
    assert matrix @ solution == pytest.approx(right, abs=1e-8)
    assert explained == pytest.approx(right @ np.linalg.solve(matrix, right), rel=1e-8)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10**6), st.integers(2, 8), st.integers(0, 5))
def test_evidence_is_the_marginal_likelihood_of_a_normal_record(
    seed: int, taps: int, decay: int
) -> None:
    random = np.random.default_rng(seed)
    stem, y = random.standard_normal(50), random.standard_normal(40)
    prior, noise = ResponsePrior(decay, 2), np.array([1.0, -0.5])
    given = Given(noise, np.zeros((1, 40)), np.empty((0, 50)), np.eye(1), y, float(y @ y))
    loss, response = evidence(stem, given, prior.precision(taps))
    rows = lagged(whitened(noise, stem, float(stem[0])), float(stem[0]) * 0.5, 10, taps)
    kernel = np.linalg.inv(prior.precision(taps))
    covariance = np.eye(40) + rows.T @ kernel @ rows
    wanted = 40 * np.log(y @ np.linalg.solve(covariance, y) / 40)
    wanted += np.linalg.slogdet(covariance)[1]
    assert loss + prior.log_determinant(taps) == pytest.approx(wanted, abs=1e-6)
    assert response == pytest.approx(kernel @ rows @ np.linalg.solve(covariance, y), abs=1e-7)
