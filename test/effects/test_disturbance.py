import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import (
    DriftDisturbance,
    RandomWalkDisturbance,
    SineDisturbance,
    SquareDisturbance,
    StepDisturbance,
    TriangleDisturbance,
)
from stiction_ros.effects.disturbance.periodic import PeriodicDisturbance
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


@pytest.mark.parametrize("kind", [SineDisturbance, SquareDisturbance, TriangleDisturbance])
@given(
    amplitude=st.floats(0.1, 10.0),
    period=st.floats(5.0, 500.0),
    phase=st.floats(-3.0, 3.0),
    time=st.floats(0.0, 1e3),
)
def test_half_a_period_later_a_wave_is_on_the_other_side(
    kind: type[PeriodicDisturbance], amplitude: float, period: float, phase: float, time: float
) -> None:
    wave = kind(amplitude, period, phase)
    now = wave.step(0.0, 0.0, time)[1]
    later = wave.step(0.0, 0.0, time + period)[1]
    assert abs(now) <= amplitude * (1.0 + 1e-12)
    if kind is not SquareDisturbance:  # which jumps
        assert later == pytest.approx(now, abs=1e-6 * amplitude)
        assert wave.step(0.0, 0.0, time + period / 2.0)[1] == pytest.approx(
            -now, abs=1e-6 * amplitude
        )


@pytest.mark.parametrize("kind", [SineDisturbance, SquareDisturbance, TriangleDisturbance])
def test_a_whole_record_at_once_is_the_same_as_one_sample_at_a_time(
    kind: type[PeriodicDisturbance],
) -> None:
    wave = kind(2.0, 37.0, 0.4)
    values = np.arange(100.0)
    stepped = [wave.step(0.0, value, 0.5 * k)[1] for k, value in enumerate(values.tolist())]
    assert wave.simulate(values, sample_time=0.5) == pytest.approx(stepped)


def test_a_square_jumps_and_a_triangle_ramps() -> None:
    square, triangle = (
        kind(2.0, 40.0).simulate(np.zeros(41)) for kind in (SquareDisturbance, TriangleDisturbance)
    )
    assert square[[0, 19, 21, 39]].tolist() == [2.0, 2.0, -2.0, -2.0]
    assert triangle[[0, 5, 10, 30]] == pytest.approx([0.0, 1.0, 2.0, -2.0])


@pytest.mark.parametrize("second", [0.5, 4.0])
def test_a_random_walk_spreads_with_the_root_of_time(second: float) -> None:
    walk = RandomWalkDisturbance(0.3)
    ends = []
    for seed in range(400):
        memory = walk.rest(0.0)
        for k, normal in enumerate(np.random.default_rng(seed).standard_normal(21).tolist()):
            memory, value = walk.step_with(memory, 0.0, k * second, normal)
        ends.append(value)
    assert np.std(ends) == pytest.approx(0.3 * math.sqrt(20 * second), rel=0.1)
    assert walk.simulate(np.ones(3)) == pytest.approx(np.ones(3))


@pytest.mark.parametrize("kind", [SquareDisturbance, TriangleDisturbance])
def test_what_enters_in_a_sample_is_the_mean_of_the_wave(
    kind: type[SquareDisturbance | TriangleDisturbance],
) -> None:
    wave, fine = kind(amplitude=2.0, period=13.7, phase=0.9), 2000
    values = wave.simulate(np.zeros(40 * fine), 0.0, 1.0 / fine).reshape(40, fine).mean(axis=1)
    near = 1e-2 if kind is SquareDisturbance else 0.15  # of a bend, its middle stands for all
    np.testing.assert_allclose(wave.entering(np.arange(40.0), 1.0), values, atol=near)
