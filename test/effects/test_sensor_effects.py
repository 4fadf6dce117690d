"""Laws of the effects on sensors, records and disturbances with a memory."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import (
    BiasStep,
    Clip,
    ColouredDisturbance,
    Freeze,
    Quantisation,
    StepDisturbance,
    Tuning,
)
from stiction_ros.errors import InputError

numbers = st.floats(-150.0, 150.0)
signals = st.lists(numbers, min_size=2, max_size=40).map(np.array)


@given(signals, st.floats(0.0, 40.0), numbers)
def test_a_bias_steps_as_a_disturbance_does(values: np.ndarray, onset: float, size: float) -> None:
    expected = StepDisturbance(onset, size).simulate(values).tolist()
    assert BiasStep(onset, size).simulate(values).tolist() == expected


@given(signals, st.floats(1e-3, 30.0))
def test_a_quantised_value_is_a_near_multiple(values: np.ndarray, quantum: float) -> None:
    out = Quantisation(quantum).simulate(values)
    assert np.abs(out - values).max() <= quantum * (0.5 + 1e-9)
    assert out / quantum == pytest.approx(np.rint(out / quantum), abs=1e-6)


@given(signals, numbers, numbers)
def test_a_sensor_shows_nothing_beyond_its_range(
    values: np.ndarray, one: float, two: float
) -> None:
    low, high = min(one, two), max(one, two)
    assert Clip(low, high).simulate(values).tolist() == values.clip(low, high).tolist()


def test_a_sensor_freezes_and_comes_back() -> None:
    frozen = Freeze(4.0, 6.0).simulate(np.arange(7.0), sample_time=2.0)
    assert frozen.tolist() == [0.0, 1.0, 1.0, 1.0, 1.0, 5.0, 6.0]


def test_a_coloured_disturbance_has_its_spread_and_its_memory() -> None:
    noise, normals = ColouredDisturbance(2.0, 20.0), np.random.default_rng(1)
    memory, waves = noise.rest(0.0), []
    for k in range(20_000):
        memory, out = noise.step_with(memory, 0.0, 2.0 * k, float(normals.standard_normal()))
        waves.append(out)
    wave = np.array(waves)
    assert wave.std() == pytest.approx(2.0, rel=0.1)
    assert np.corrcoef(wave[1:], wave[:-1])[0, 1] == pytest.approx(math.exp(-0.1), abs=0.01)


def test_without_draws_a_coloured_disturbance_is_what_is_expected_of_it() -> None:
    noise = ColouredDisturbance(2.0, 20.0)
    assert noise.simulate(np.ones(5)).tolist() == [1.0] * 5
    memory, out = noise.step_with(noise.rest(0.0), 0.0, 0.0, 1.5)
    assert noise.step(memory, 0.0, 20.0)[1] == pytest.approx(out / math.e)


def test_a_tuning_is_the_controller_of_the_loop_model() -> None:
    error = np.array([0.0, 1.0, 1.0, -0.5])
    op = Tuning(2.0, 8.0).simulate(error, sample_time=4.0)
    assert op.tolist() == [0.0, 3.0, 4.0, 0.5]


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        (Tuning, {"gain": 1.0, "integral_time": 0.0}),
        (Quantisation, {"step": 0.0}),
        (ColouredDisturbance, {"std": -1.0, "tau": 1.0}),
        (Freeze, {"time": 0.0, "duration": -1.0}),
        (Clip, {"low": 2.0, "high": 1.0}),
    ],
)
def test_what_makes_no_sense_is_refused(kind: type, values: dict[str, float]) -> None:
    with pytest.raises(InputError):
        kind.from_mapping(values)
