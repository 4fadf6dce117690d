"""Noise of one signal: what is made white, what is found again."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from stiction_ros.effects import FloatArray
from stiction_ros.signals.autoregression import (
    best_autoregression,
    coloured,
    gain_of_noise,
    innovations,
    noise_of,
    whiten,
    whitened_rows,
)

COUNT = 400
TRAIN = (np.arange(COUNT) % 50 < 37) & (np.arange(COUNT) >= 7)
SEEDS = st.integers(0, 10_000)


def drawn(seed: int, *shape: int) -> FloatArray:
    return np.random.default_rng(seed).standard_normal(shape)


@given(st.lists(st.floats(-0.9, 0.9), min_size=0, max_size=4), st.integers(0, 100))
@settings(max_examples=20)
def test_whitening_undoes_colouring(ar: list[float], seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal((50, 2))
    shaped = coloured(noise, np.array(ar))
    rounding = max(1e-6, 1e-14 * float(np.abs(shaped).max()))  # some of these grow without end
    assert whiten(shaped, np.array(ar)) == pytest.approx(noise, rel=1e-6, abs=rounding)


def test_coloured_noise_remembers() -> None:
    assert coloured(np.eye(4)[0], np.array([0.5, 0.25])) == pytest.approx([1.0, 0.5, 0.5, 0.375])


def test_marked_rows_of_a_white_signal_are_bit_for_bit_those_of_all() -> None:
    values, ar = drawn(12, COUNT), np.array([0.7, -0.2])
    assert np.array_equal(whitened_rows(values, ar, TRAIN), whiten(values, ar)[TRAIN])


def test_innovations_begin_where_the_signal_rested() -> None:
    noise, values = np.array([1.0, -0.7, 0.2]), 5.0 + drawn(13, COUNT)
    rested = np.concatenate([np.full(2, values[0]), values])
    assert innovations(noise, values) == pytest.approx(np.convolve(rested, noise)[2:-2])


def test_a_polynomial_is_that_of_the_noise() -> None:
    values = coloured(drawn(14, 20_000), np.array([0.9, -0.3]))
    assert noise_of(values, 2) == pytest.approx([1.0, -0.9, 0.3], abs=0.02)
    assert values.var() == pytest.approx(gain_of_noise(np.array([0.9, -0.3])), rel=0.05)


def test_white_noise_needs_no_memory() -> None:
    assert len(best_autoregression(drawn(2, COUNT), TRAIN, 6)[0]) == 0


@given(SEEDS, st.floats(-0.95, 0.95))
def test_autoregression_solves_the_normal_equations(seed: int, first: float) -> None:
    residual = np.asarray(lfilter([1.0], [1.0, -first, 0.3], drawn(seed, COUNT)))
    phi = best_autoregression(residual, TRAIN, 6)[0]
    late = [np.concatenate([np.zeros(k), residual[: COUNT - k]])[TRAIN] for k in range(7)]
    lagged = np.column_stack(late[1 : len(phi) + 1]) if len(phi) else np.zeros((TRAIN.sum(), 0))
    wanted = np.linalg.lstsq(lagged, late[0], rcond=None)[0]
    assert phi == pytest.approx(wanted, rel=1e-7, abs=1e-9)


@given(SEEDS)
def test_the_order_is_the_one_of_least_bic(seed: int) -> None:
    residual = np.asarray(lfilter([1.0], [1.0, -0.5, 0.0, 0.2], drawn(seed, COUNT)))
    late = [np.concatenate([np.zeros(k), residual[: COUNT - k]])[TRAIN] for k in range(7)]
    scores = []
    for order in range(7):
        inner = np.column_stack([np.zeros_like(late[0]), *late[1 : order + 1]])
        left = late[0] - inner @ np.linalg.lstsq(inner, late[0], rcond=None)[0]
        scores.append(len(left) * np.log(left @ left) + order * np.log(len(left)))
    assert len(best_autoregression(residual, TRAIN, 6)[0]) == int(np.argmin(scores))
