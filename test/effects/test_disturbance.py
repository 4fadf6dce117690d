from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import DriftDisturbance, SineDisturbance, StepDisturbance
from stiction_ros.errors import InputError

signal = st.floats(-1e3, 1e3)
seconds = st.floats(0.0, 1e5)


@given(signal, seconds, seconds, signal)
def test_a_step_adds_its_size_from_its_onset_on(
    value: float, time: float, onset: float, size: float
) -> None:
    expected = value + size if time >= onset else value
    assert StepDisturbance(onset, size).step(0.0, value, time)[1] == expected


@given(signal, seconds, st.floats(-1.0, 1.0))
def test_a_drift_adds_rate_times_time(value: float, time: float, rate: float) -> None:
    assert DriftDisturbance(rate).step(0.0, value, time)[1] == value + rate * time


def test_a_sine_returns_to_zero_after_each_period() -> None:
    sine = SineDisturbance(3.0, 40.0)
    added = sine.simulate(np.zeros(81), sample_time=1.0)
    assert added[[0, 20, 40, 80]] == pytest.approx(0.0, abs=1e-12)
    assert (added[10], added[30]) == pytest.approx((3.0, -3.0))


@pytest.mark.parametrize("values", [{"amplitude": -1.0}, {"period": 0.0}, {"period": math.nan}])
def test_a_sine_that_does_not_swing_is_refused(values: dict[str, float]) -> None:
    with pytest.raises(InputError) as caught:
        SineDisturbance.from_mapping({"amplitude": 1.0, "period": 1.0} | values)
    assert caught.value.where == next(iter(values))
