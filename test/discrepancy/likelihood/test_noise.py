"""The likelihood of a gap under autoregressive noise."""

import numpy as np
import pytest

from stiction_ros.discrepancy.likelihood.noise import Blocks, fit_noise
from stiction_ros.effects import FloatArray
from stiction_ros.signals.autoregression import coloured

COUNT = 1500


def blocks() -> Blocks:
    train = np.arange(COUNT) % 100 < 75
    train[:10] = False
    return Blocks(train, ~train & (np.arange(COUNT) >= 10))


def drawn(seed: int, ar: FloatArray) -> FloatArray:
    return coloured(np.random.default_rng(seed).standard_normal(COUNT), ar)


def test_the_noise_of_first_order_is_found() -> None:
    fit = fit_noise(drawn(1, np.array([0.9])), np.zeros((COUNT, 0)), blocks())
    assert fit.ar[0] == pytest.approx(0.9, abs=0.05)


def test_a_step_under_coloured_noise_is_sized() -> None:
    step = (np.arange(COUNT) > 700).astype(float)
    fit = fit_noise(drawn(3, np.array([0.8])) + 9.0 * step, step[:, None], blocks())
    assert fit.coefficients[0] == pytest.approx(9.0, abs=1.0)


def test_the_spread_of_stationary_noise_is_that_of_its_model() -> None:
    fit = fit_noise(drawn(4, np.array([0.9])), np.zeros((COUNT, 0)), blocks())
    assert fit.stationary_std == pytest.approx(1.0 / np.sqrt(1.0 - 0.81), rel=0.25)


def test_held_out_rows_change_no_figure() -> None:
    values = drawn(5, np.array([0.5]))
    own = blocks()
    other = values.copy()
    # Rows of the last part of every held-out block lie before no fitted row's memory.
    other[own.held & (np.arange(COUNT) % 100 > 78) & (np.arange(COUNT) % 100 < 92)] += 50.0
    first = fit_noise(values, np.zeros((COUNT, 0)), own)
    second = fit_noise(other, np.zeros((COUNT, 0)), own)
    assert first.innovation_std == second.innovation_std
