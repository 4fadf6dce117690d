import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from known_loops import DELAY, Kind, known

from stiction_ros.loop.linear_loops import Process, ringing
from stiction_ros.signals.outside_line import NO_LINE, Predicted, beside, outside_line

COUNT = 900


def moved(wave: np.ndarray, seed: int = 0) -> Predicted:
    """Return PV of a healthy loop that a wave moves from behind the valve, and OP."""
    record = known(Kind(noise=0.05), seed, samples=COUNT, load=wave).record
    return Predicted(record.pv[:, 0], [record.op[:, 0]], [DELAY + 1])


def sine(size: float, period: float) -> np.ndarray:
    return size * np.sin(2 * np.pi * np.arange(COUNT) / period)


@settings(max_examples=10)
@given(period=st.floats(12.0, 120.0), seed=st.integers(0, 50), off=st.floats(-0.8, 0.8))
def test_a_wave_from_outside_is_found_near_its_period(period: float, seed: int, off: float) -> None:
    wave = np.sign(sine(1.0, period)) * 0.3
    found = outside_line(moved(wave, seed), 1.0 / (1.0 / period + off / COUNT))
    assert found.gain > 30.0
    assert found.period == pytest.approx(period, rel=0.3 * period / COUNT)


@pytest.mark.parametrize("seed", range(6))
def test_there_is_no_line_behind_a_valve_that_makes_the_cycle(seed: int) -> None:
    record = known(Kind(friction=(3.0, 1.0), noise=0.1), seed, samples=COUNT).record
    assert record.stem is not None
    true = Predicted(record.pv[:, 0], [record.stem[:, 0]], [DELAY + 1])
    assert outside_line(true, 66.0).gain < 0.0


@pytest.mark.parametrize("seed", range(6))
def test_there_is_no_line_in_noise(seed: int) -> None:
    assert outside_line(moved(np.zeros(COUNT), seed), 40.0).gain < 0.0


@given(scale=st.floats(0.01, 100.0), shift=st.floats(-100.0, 100.0))
@example(scale=0.01, shift=47.0)
@settings(max_examples=10)
def test_units_change_no_gain(scale: float, shift: float) -> None:
    signal = moved(sine(0.3, 50.0))
    other = Predicted(signal.y * scale + shift, [shift - x / scale for x in signal.inputs], [3])
    assert outside_line(other, 50.0).gain == pytest.approx(
        outside_line(signal, 50.0).gain, abs=1e-3
    )


def test_too_few_rows_and_too_short_a_period_say_nothing() -> None:
    short = Predicted(np.zeros(40), [np.zeros(40)], [1])
    assert outside_line(short, 10.0) == NO_LINE
    assert outside_line(moved(np.zeros(COUNT)), 2.0) == NO_LINE


def test_the_process_beside_a_wave_does_not_ring_with_it() -> None:
    a, b = beside(moved(sine(1.0, 50.0)), 50.0)
    assert a.shape == (3,)
    assert b.shape == (1, 3)
    process = Process(a[None], b[None], np.array([[DELAY]]), np.zeros(1))
    rings = ringing(process, 0, 0, np.array([1.0, 1.0 / 8.0, 0.0]))
    assert all(one.growth < 0.6 for one in rings if 35.0 < one.period < 70.0)
