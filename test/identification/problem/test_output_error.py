"""The free-run fit with autoregressive noise, and the compiled code below it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from stiction_ros.effects import FloatArray
from stiction_ros.identification.kernels.output_error import THIN, evaluate, normal_equations
from stiction_ros.identification.kernels.row import driven_rows, lag_products
from stiction_ros.identification.problem.output_error import Orders, fit_output, pose, room_for
from stiction_ros.signals.polynomials import is_stable, stabilised

A = np.array([1.0, -1.5, 0.6])
seeds = st.integers(0, 10_000)


def driven(seed: int, delay: int, samples: int = 600) -> tuple[FloatArray, FloatArray]:
    """Return a stem that jumps and the free response of 0.3 q^-1 / A to it, delayed."""
    generator = np.random.default_rng(seed)
    stem = np.repeat(generator.standard_normal(samples // 10), 10)
    return stem, lfilter(np.r_[np.zeros(delay + 1), 0.3], A, stem)


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


@settings(max_examples=20)
@given(seed=seeds, weight=st.floats(0.0, 1.0))
def test_point_is_the_least_squares_solution_over_everything_linear(
    seed: int, weight: float
) -> None:
    generator = np.random.default_rng(seed)
    stem, y = driven(seed, 1, 200)
    y = y + generator.standard_normal(len(y))
    first, begin, d = 20, 19, np.array([1.0, -0.4])
    orders = Orders(2, 2, 1, first)
    problem = pose(y, stem[None, :], (1,), orders)
    room = room_for(problem, orders)
    point = evaluate(problem, room, A, d, weight)
    initial = [np.eye(1, len(y), begin - i)[0] for i in (0, 1)]
    columns = [np.r_[np.zeros(i), stem[: len(y) - i]] for i in (2, 3)]
    columns += [np.ones(len(y)), *initial]
    plain = np.stack([lfilter([1.0], A, x) for x in columns], axis=1)
    rows, target = [lfilter(d, [1.0], plain, axis=0)[first:]], [lfilter(d, [1.0], y)[first:]]
    prices = np.sqrt(weight) * np.r_[1.0, np.full(45, np.sqrt(THIN))]
    priced = begin + np.r_[0, 1 : len(y) - begin : THIN]
    rows.append(prices[:, None] * plain[priced])
    target.append(prices * y[priced])
    matrix, right = np.vstack(rows), np.concatenate(target)
    residual = right - matrix @ np.linalg.lstsq(matrix, right)[0]
    assert point.total == pytest.approx(residual @ residual, rel=1e-9)


@settings(max_examples=20)
@given(seed=seeds, weight=st.floats(0.0, 1.0))
def test_gradient_is_the_slope_of_the_criterion(seed: int, weight: float) -> None:
    stem, y = driven(seed, 1, 200)
    y = y + np.random.default_rng(seed).standard_normal(len(y))
    orders = Orders(2, 1, 2, 20)
    problem = pose(y, stem[None, :], (1,), orders)
    room = room_for(problem, orders)
    d, way = np.array([1.0, -0.4, 0.1]), np.random.default_rng(seed + 1).standard_normal(4)
    point = evaluate(problem, room, A, d, weight)
    gradient = normal_equations(problem, room, point)[1]
    # along differences of the lags of A: ∇_0 = a_1, ∇_1 = a_1 − a_2
    slope_a, slope_d = np.r_[0.0, room.tables[1].T @ way[:2]], np.r_[0.0, way[2:]]
    ends = [
        evaluate(problem, room, A + h * slope_a, d + h * slope_d, weight).total
        for h in (1e-6, -1e-6)
    ]
    assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(2.0 * gradient @ way, rel=1e-4, abs=1e-3)


@given(sizes=st.lists(st.floats(0.1, 3.0), min_size=1, max_size=3))
def test_roots_are_pulled_inside(sizes: list[float]) -> None:
    rays = np.exp(1j * np.array([0.4, 1.4, 2.6])[: len(sizes)])  # apart from each other
    given, inside = (x * rays for x in (np.array(sizes), np.minimum(sizes, 0.9)))
    polynomial, expected = (np.poly(np.r_[roots, roots.conj()]).real for roots in (given, inside))
    assert stabilised(polynomial, 0.9) == pytest.approx(expected, abs=1e-9)


@settings(max_examples=20)
@given(seed=seeds, order=st.integers(0, 6))
def test_products_of_lags(seed: int, order: int) -> None:
    w = np.random.default_rng(seed).standard_normal(50)
    lags = np.stack([w[order - i : len(w) - i] for i in range(order + 1)])
    assert lag_products(w, order) == pytest.approx(np.triu(lags @ lags.T), abs=1e-12)


@pytest.mark.parametrize("order", [0, 1, 2, 3, 4, 5])
@pytest.mark.parametrize("signals", [1, 2, 3])
def test_signals_through_any_order(order: int, signals: int) -> None:
    x = np.random.default_rng(order).standard_normal((signals, 60))
    a, out = np.atleast_1d(np.poly(np.linspace(-0.5, 0.8, order))), np.zeros_like(x)
    driven_rows(a, x, 0, signals, out)
    assert out == pytest.approx(lfilter([1.0], a, x), rel=1e-9)


@settings(max_examples=10)
@given(seed=seeds, delay=st.integers(0, 4))
def test_noise_on_the_measurement_leaves_the_process_unbiased(seed: int, delay: int) -> None:
    stem, y = driven(seed, delay, 2000)
    y = y + 0.1 * np.random.default_rng(seed + 1).standard_normal(len(y))
    fit = fit_output(y, stem[None, :], (delay,), Orders(2, 1, 2, 20))
    assert fit.a == pytest.approx(A, abs=0.02)
    assert fit.b[0, 0] == pytest.approx(0.3, abs=0.02)
    assert np.sqrt(fit.energy / fit.count) == pytest.approx(0.1, rel=0.1)


@settings(max_examples=10)
@given(seed=seeds)
def test_coloured_noise_is_whitened(seed: int) -> None:
    stem, y = driven(seed, 1, 2000)
    white = 0.1 * np.random.default_rng(seed + 1).standard_normal(len(y))
    y = y + lfilter([1.0], [1.0, -0.8], white)
    fit = fit_output(y, stem[None, :], (1,), Orders(2, 1, 1, 20))
    assert fit.noise == pytest.approx([1.0, -0.8], abs=0.06)
    expected = lfilter(fit.noise, [1.0], y[19:] - fit.free_run)[1:]
    assert fit.innovations == pytest.approx(expected, abs=1e-9)
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


@pytest.mark.parametrize("level", [0.0, 3.0])
def test_an_output_at_rest_is_fitted(level: float) -> None:
    stem = np.random.default_rng(0).standard_normal(200).cumsum()
    fit = fit_output(np.full(200, level), stem[None, :], (1,), Orders(1, 1, 0, 20))
    assert fit.energy <= 1e-20 * max(level, 1.0)
