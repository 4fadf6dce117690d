"""White noise beside a first-order one."""

import numpy as np

from stiction_ros.discrepancy.likelihood.noise import MAX_ORDER, Blocks, fit_noise
from stiction_ros.discrepancy.likelihood.slow_noise import slow_beside_white
from stiction_ros.effects import FloatArray
from stiction_ros.signals.autoregression import coloured, gain_of_noise, whiten

COUNT, KEEP = 4000, 0.99


def slow_and_white() -> FloatArray:
    random = np.random.default_rng(3)
    slow = coloured(0.1 * random.standard_normal(COUNT), np.array([KEEP]))
    return np.asarray(slow + random.standard_normal(COUNT))


def test_both_poles_are_those_of_the_noise() -> None:
    ar = slow_beside_white(slow_and_white(), np.ones(COUNT, dtype=bool))
    ratio = 0.1**2 + 1.0 + KEEP**2
    forget = (ratio - np.sqrt(ratio**2 - 4.0 * KEEP**2)) / (2.0 * KEEP)  # of the sum of both
    assert np.isclose(ar[1] / ar[0], forget, atol=0.02)
    assert np.isclose(ar[0], KEEP - forget, atol=0.02)


def test_a_noise_that_forgets_slowly_is_told_by_two_figures() -> None:
    values, rows = slow_and_white(), np.ones(COUNT, dtype=bool)
    rows[:MAX_ORDER] = False
    fit = fit_noise(values, np.ones((COUNT, 1)), Blocks(rows, ~rows))
    assert len(fit.ar) > MAX_ORDER
    assert np.isclose(fit.price, 2.0 * np.log(fit.rows))
    left = whiten(fit.residual, fit.ar)[rows]
    shares = [left[lag:] @ left[:-lag] / (left @ left) for lag in range(1, 20)]
    assert float(np.abs(shares).max()) < 4.0 / np.sqrt(COUNT)
    assert np.isclose(np.std(left), fit.innovation_std)


def test_the_gain_of_a_noise_is_that_of_its_answers() -> None:
    ar = 0.3 * 0.9 ** np.arange(20)
    answers = coloured(np.eye(1, 5000)[0], 0.1 * ar)
    assert np.isclose(gain_of_noise(0.1 * ar), answers @ answers)
