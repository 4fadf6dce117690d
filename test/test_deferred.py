"""What stands in for slow packages of SciPy gives their numbers."""

import numpy as np
import pytest
from scipy import signal, stats
from scipy.stats import qmc

from stiction_ros.deferred import chi2_quantile, halton_sequence, lfilter
from stiction_ros.signals.polynomials import filtered, recursion

ORDERS = [(1, 1), (1, 3), (2, 2), (3, 1), (5, 2), (4, 9)]


@pytest.mark.parametrize(("poles", "zeros"), ORDERS)
def test_filters(poles: int, zeros: int) -> None:
    generator = np.random.default_rng(poles)
    a = np.concatenate([[1.0], 0.3 * generator.standard_normal(poles)])
    b, values = generator.standard_normal(zeros), generator.standard_normal((4, 200))
    wanted = signal.lfilter(b, a, values)
    assert np.array_equal(lfilter(b, a, values), wanted)
    assert np.array_equal(lfilter(b, a, values.T, axis=0), wanted.T)
    assert filtered(b, a, values[0]) == pytest.approx(wanted[0], rel=1e-9)


@pytest.mark.parametrize("order", [1, 2, 3, 9])
def test_a_recursion_from_a_measured_past(order: int) -> None:
    generator = np.random.default_rng(order)
    a = np.concatenate([[1.0], 0.3 * generator.standard_normal(order)])
    driving, past = generator.standard_normal(200), generator.standard_normal(order)
    state = signal.lfiltic([1.0], a, past[::-1])
    wanted = signal.lfilter([1.0], a, driving, zi=state)[0]
    assert recursion(a, driving, past) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("freedom", [1, 2, 3, 5])
def test_quantiles(freedom: int) -> None:
    for level in (0.5, 0.95, 0.999):
        assert chi2_quantile(level, freedom) == pytest.approx(stats.chi2.ppf(level, freedom))


def test_scattered_points() -> None:
    assert np.array_equal(halton_sequence(3, 0).random(5), qmc.Halton(3, seed=0).random(5))
