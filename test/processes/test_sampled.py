"""Transfer functions at their samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete, lfilter

from stiction_ros.errors import InputError
from stiction_ros.processes.sampled import Channel, equation, held, transition

SAMPLES = 40


def response(of: Channel) -> np.ndarray:
    """Return the answer to a step of the stem at sample 0, shape (N,)."""
    b, a, delay = of
    return np.asarray(lfilter([*np.zeros(1 + delay), *b], a, np.ones(SAMPLES)))


@given(
    gain=st.floats(-5.0, 5.0),
    lag=st.floats(0.3, 100.0),
    dead_time=st.floats(0.0, 20.0),
    step=st.floats(0.5, 3.0),
)
def test_a_lag_with_any_dead_time_answers_as_by_its_formula(
    gain: float, lag: float, dead_time: float, step: float
) -> None:
    found = response(held([gain], [lag, 1.0], dead_time, step))
    since = np.maximum(step * np.arange(SAMPLES) - dead_time, 0.0)
    assert found == pytest.approx(gain * -np.expm1(-since / lag), abs=1e-6)


@pytest.mark.parametrize("num", [[2.0], [3.0, 1.0]])
def test_it_is_the_zero_order_hold_of_scipy(num: list[float]) -> None:
    den = [6.0, 5.0, 2.0, 1.0]
    (taps,), poles, _ = cont2discrete((num, den), 0.7)
    found, own, delay = held(num, den, 1.4, 0.7)
    assert delay == 2
    assert found == pytest.approx(taps[1:])
    assert own == pytest.approx(poles)
    a, b = np.diag([-1.0, -0.2]), np.ones((2, 2))
    phi, gamma, *_ = cont2discrete((a, b, b, 0.0 * b), 0.7)
    assert np.allclose(np.hstack(transition(a, b, 0.7)), np.hstack([phi, gamma]))


def test_valves_of_one_output_get_one_denominator() -> None:
    both = {
        "V1": held([1.0], [5.0, 1.0], 0.3, 1.0),
        "V2": held([2.0, 1.0], [8.0, 6.0, 1.0], 3.0, 1.0),
    }
    found = equation(both)
    assert found["delay"] == {"V1": 0, "V2": 3}
    for valve, alone in both.items():
        whole = found["b"][valve], [1.0, *found["a"]], found["delay"][valve]
        assert response(whole) == pytest.approx(response(alone))


@pytest.mark.parametrize("den", [[8.0, 1.0], [0.0, 1.0], [1.0], []])
def test_what_answers_at_once_is_refused(den: list[float]) -> None:
    with pytest.raises(InputError, match="answers at once: num has 2 coefficients, den"):
        held([1.0, 1.0], den, 0.0, 1.0)
