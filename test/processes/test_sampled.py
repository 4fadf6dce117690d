"""Continuous processes at their samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import cont2discrete

from stiction_ros.errors import InputError
from stiction_ros.processes.sampled import Sampled, beside, companion, held

SAMPLES = 40


def response(process: Sampled) -> np.ndarray:
    """Return the answer of the outputs to a step of the first input, shape (N, p)."""
    a, b, c = process.with_past()
    state, found = np.zeros(len(a)), []
    for _ in range(SAMPLES):
        found.append(c @ state)
        state = a @ state + b[:, 0]
    return np.array(found)


@settings(max_examples=30, deadline=None)
@given(
    gain=st.floats(-5.0, 5.0),
    lag=st.floats(0.3, 100.0),
    dead_time=st.floats(0.0, 20.0),
    step=st.floats(0.5, 3.0),
)
def test_a_lag_with_any_dead_time_answers_as_by_its_formula(
    gain: float, lag: float, dead_time: float, step: float
) -> None:
    found = response(held(*companion([gain], [lag, 1.0]), dead_time, step))[:, 0]
    since = np.maximum(step * np.arange(SAMPLES) - dead_time, 0.0)
    assert found == pytest.approx(gain * -np.expm1(-since / lag), abs=1e-6)


def test_without_dead_time_it_is_the_zero_order_hold_of_scipy() -> None:
    random = np.random.default_rng(2)
    a, b, c = random.normal(size=(3, 3)), random.normal(size=(3, 2)), np.eye(3)
    phi, gamma, *_ = cont2discrete((a, b, c, np.zeros((3, 2))), 0.7)
    found = held(a, b, c, 0.0, 0.7)
    assert found.taps.shape == (1, 3, 2)
    assert np.allclose(found.a, phi)
    assert np.allclose(found.taps[0], gamma)
    late = held(a, b, c, 1.4, 0.7)
    assert late.taps.shape == (3, 3, 2)
    assert not late.taps[:2].any()
    assert np.allclose(late.taps[2], gamma)


@pytest.mark.parametrize("inputs", [1, 2])
def test_past_inputs_are_states(inputs: int) -> None:
    random = np.random.default_rng(inputs)
    a, taps = np.diag([0.5, -0.3]), random.normal(size=(4, 2, inputs))
    whole, b, c = Sampled(a, taps, np.eye(2)).with_past()
    op = random.normal(size=(SAMPLES, inputs))
    past = np.vstack([np.zeros((3, inputs)), op])
    state, wanted = np.zeros(len(whole)), np.zeros(2)
    for k in range(SAMPLES):
        assert c @ state == pytest.approx(wanted)
        wanted = a @ wanted + sum(taps[i] @ past[3 + k - i] for i in range(4))
        state = whole @ state + b @ op[k]


def test_channels_stand_beside_each_other() -> None:
    first, second = (held(*companion([k], [k, 1.0]), k - 1.0, 1.0) for k in (1.0, 3.0))
    both = response(beside({(0, 0): first, (1, 0): second}, 2, 1))
    assert both[:, 0] == pytest.approx(response(first)[:, 0])
    assert both[:, 1] == pytest.approx(response(second)[:, 0])
    assert not response(beside({(0, 1): first}, 1, 2)).any()


@pytest.mark.parametrize("den", [[8.0, 1.0], [0.0, 1.0], [1.0], []])
def test_what_answers_at_once_is_refused(den: list[float]) -> None:
    with pytest.raises(InputError, match="answers at once: 2 coefficients above and"):
        companion([1.0, 1.0], den)
