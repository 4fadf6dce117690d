"""The free-run fit with autoregressive noise, and the compiled code below it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from stiction_ros.effects import FloatArray
from stiction_ros.identification.output_error import Orders, fit_output
from stiction_ros.identification.output_error_kernels import Problem, evaluate, is_stable

A = np.array([1.0, -1.5, 0.6])
seeds = st.integers(0, 10_000)


def driven(seed: int, delay: int, samples: int = 600) -> tuple[FloatArray, FloatArray]:
    """Return a stem that jumps and the free response of 0.3 q^-1 / A to it, delayed."""
    generator = np.random.default_rng(seed)
    stem = np.repeat(generator.standard_normal(samples // 10), 10)
    return stem, lfilter(np.r_[np.zeros(delay + 1), 0.3], A, stem)


@settings(deadline=None)
@given(roots=st.lists(st.floats(-1.3, 1.3), min_size=1, max_size=5), radius=st.floats(0.5, 1.0))
def test_stability_is_that_of_the_roots(roots: list[float], radius: float) -> None:
    largest = max(abs(root) for root in roots)
    if abs(largest - radius) > 1e-3:
        assert is_stable(np.poly(roots), radius) == (largest < radius)


def test_stability_of_complex_roots() -> None:
    pair = 0.9 * np.exp(1j * np.array([1.0, -1.0]))
    polynomial = np.poly(np.r_[pair, 0.2]).real
    assert is_stable(polynomial, 0.91)
    assert not is_stable(polynomial, 0.89)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, weight=st.floats(0.0, 1.0))
def test_point_is_the_least_squares_solution_over_everything_linear(
    seed: int, weight: float
) -> None:
    generator = np.random.default_rng(seed)
    stem, y = driven(seed, 1, 200)
    y = y + generator.standard_normal(len(y))
    first, begin, d = 20, 19, np.array([1.0, -0.4])
    priced, prices = np.arange(len(y) - begin), np.full(len(y) - begin, 0.7)
    signals = np.stack([stem, np.ones(len(y))])
    problem = Problem(y, signals, np.array([[0, 2, 2], [1, 0, 1]]), begin, first, priced, prices)
    point = evaluate(problem, A, d, weight)
    lags = [np.r_[np.zeros(i), stem[: len(y) - i]] for i in (2, 3)]
    plain = np.stack([lfilter([1.0], A, x) for x in (*lags, np.ones(len(y)))], axis=1)
    rows = [lfilter(d, [1.0], plain, axis=0)[first:]]
    target = [lfilter(d, [1.0], y)[first:]]
    if weight > 0.0:
        rows.append(np.sqrt(weight) * 0.7 * plain[begin:])
        target.append(np.sqrt(weight) * 0.7 * y[begin:])
    matrix, right = np.vstack(rows), np.concatenate(target)
    residual = right - matrix @ np.linalg.lstsq(matrix, right)[0]
    assert point.residual @ point.residual == pytest.approx(residual @ residual, rel=1e-9)


@settings(max_examples=10, deadline=None)
@given(seed=seeds, delay=st.integers(0, 4))
def test_noise_on_the_measurement_leaves_the_process_unbiased(seed: int, delay: int) -> None:
    stem, y = driven(seed, delay, 2000)
    y = y + 0.1 * np.random.default_rng(seed + 1).standard_normal(len(y))
    fit = fit_output(y, stem[None, :], (delay,), Orders(2, 1, 2, 20))
    assert fit.a == pytest.approx(A, abs=0.02)
    assert fit.b[0, 0] == pytest.approx(0.3, abs=0.02)
    assert np.sqrt(fit.energy / fit.count) == pytest.approx(0.1, rel=0.1)


@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_coloured_noise_is_whitened(seed: int) -> None:
    stem, y = driven(seed, 1, 2000)
    white = 0.1 * np.random.default_rng(seed + 1).standard_normal(len(y))
    y = y + lfilter([1.0], [1.0, -0.8], white)
    fit = fit_output(y, stem[None, :], (1,), Orders(2, 1, 1, 20))
    assert fit.noise == pytest.approx([1.0, -0.8], abs=0.06)
    assert fit.innovations.std() == pytest.approx(0.1, rel=0.1)


def test_a_stem_that_stands_still_leaves_a_constant() -> None:
    y = 3.0 + 0.1 * np.random.default_rng(0).standard_normal(300)
    fit = fit_output(y, np.zeros((1, 300)), (1,), Orders(1, 1, 1, 20))
    assert fit.b[0, 0] == 0.0
    assert np.sqrt(fit.energy / fit.count) == pytest.approx(0.1, rel=0.2)


def test_a_neighbouring_fit_is_a_start_that_ends_no_worse() -> None:
    stem, y = driven(5, 2, 800)
    y = y + 0.2 * np.random.default_rng(6).standard_normal(len(y))
    orders = Orders(2, 1, 2, 20)
    cold = fit_output(y, stem[None, :], (2,), orders)
    warm = fit_output(y, stem[None, :], (2,), orders, cold)
    assert warm.loss <= cold.loss + 1e-6
