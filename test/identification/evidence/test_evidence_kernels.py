from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.evidence.kernels import (
    Given,
    answered,
    evidence,
    factorised,
    lagged_products,
    lagged_with,
    own_products,
    solved,
    whitened,
    with_past,
)
from stiction_ros.identification.evidence.response_prior import ResponsePrior


def _groups(signal: FloatArray, before: float, first: int, edges: IntArray) -> FloatArray:
    """Return the groups of lags written out, shape (r, N − first)."""
    whole = np.append(np.full(edges[-1], before), signal)
    rows = [whole[edges[-1] + first - 1 - i : len(whole) - 1 - i] for i in range(int(edges[-1]))]
    return np.add.reduceat(np.array(rows), edges[:-1])


EDGES = st.lists(st.integers(1, 4), min_size=1, max_size=5).map(
    lambda widths: np.append(0, np.cumsum(widths))
)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), EDGES, st.integers(0, 20))
def test_products_of_lags_are_those_of_the_rows(seed: int, edges: IntArray, first: int) -> None:
    signal, other = np.random.default_rng(seed).standard_normal((2, 60))
    rows = _groups(signal, float(signal[0]), first, edges)
    others = _groups(other, float(other[0]), first, edges)
    one, two = (with_past(x, int(edges[-1])) for x in (signal, other))
    found = lagged_products(one, two, 60 - first, edges)
    assert found == pytest.approx(rows @ others.T, abs=1e-9)
    assert own_products(one, 60 - first, edges) == pytest.approx(rows @ rows.T, abs=1e-9)
    assert lagged_with(one, other[first:], edges) == pytest.approx(rows @ other[first:], abs=1e-9)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(1, 12), st.integers(1, 30))
def test_a_response_answers_to_what_was_before_the_record(seed: int, taps: int, rows: int) -> None:
    random = np.random.default_rng(seed)
    signal, response = random.standard_normal(rows), random.standard_normal(taps)
    lags = _groups(signal, float(signal[0]), 0, np.arange(taps + 1))
    assert answered(signal, response) == pytest.approx(response @ lags, abs=1e-9)


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
@given(st.integers(0, 10**6), EDGES, st.integers(0, 5))
def test_evidence_is_the_marginal_likelihood_of_a_normal_record(
    seed: int, edges: IntArray, decay: int
) -> None:
    random = np.random.default_rng(seed)
    stem, y = random.standard_normal(50), random.standard_normal(40)
    prior, noise = ResponsePrior(decay, 2), np.array([1.0, -0.5])
    given = Given(noise, np.zeros((1, 40)), np.empty((0, 50)), np.eye(1), y, float(y @ y), edges)
    loss, response = evidence(stem, given, prior.precision(edges))
    rows = _groups(whitened(noise, stem, float(stem[0])), float(stem[0]) * 0.5, 10, edges)
    kernel = np.linalg.inv(prior.precision(edges))
    covariance = np.eye(40) + rows.T @ kernel @ rows
    wanted = 40 * np.log(y @ np.linalg.solve(covariance, y) / 40)
    wanted += np.linalg.slogdet(covariance)[1]
    assert loss + prior.log_determinant(edges) == pytest.approx(wanted, abs=1e-6)
    assert response == pytest.approx(kernel @ rows @ np.linalg.solve(covariance, y), abs=1e-7)
