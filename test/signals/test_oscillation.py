import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.signals.oscillation import (
    LEAST_LINE,
    NEEDED_CYCLES,
    REGULAR,
    dominant_cycle,
    oscillation,
    pieces,
    regularity,
    slow_mean,
)


def wave(size: float, period: float, samples: int) -> np.ndarray:
    return size * np.sin(2 * np.pi * np.arange(samples) / period + 0.3)


@given(
    period=st.floats(10.0, 80.0),
    size=st.floats(0.01, 50.0),
    drift=st.floats(-3.0, 3.0),
    seed=st.integers(0, 100),
)
def test_a_sine_in_noise_on_a_drift_is_seen(
    period: float, size: float, drift: float, seed: int
) -> None:
    noise = 0.4 * np.random.default_rng(seed).standard_normal(900)
    values = size * (wave(1.0, period, 900) + noise + drift * np.linspace(0.0, 1.0, 900))
    found = oscillation(values, [(0, 900)])
    assert found is not None
    assert found.period == pytest.approx(period, rel=0.03)
    assert found.amplitude == pytest.approx(size, rel=0.15)
    assert found.regularity > 1.5
    assert found.share > LEAST_LINE


def test_nothing_is_faster_than_two_samples() -> None:
    values = np.random.default_rng(4).standard_normal((901, 1))
    found = dominant_cycle(values, [(0, 901)], (1.5, 3.0))
    assert found is not None
    assert found.period >= 2.0


def test_what_turns_at_each_sample_is_an_oscillation() -> None:
    noise = np.random.default_rng(4).standard_normal(901)
    values = noise[1:] * 0.2 + np.where(np.arange(900) % 2, 1.0, -1.0)
    found = oscillation(values, [(0, 900)])
    assert found is not None
    assert found.period == pytest.approx(2.0, rel=0.02)
    assert found.regularity > 1.5
    assert found.share > LEAST_LINE


def test_noise_is_irregular() -> None:
    found = [
        oscillation(np.random.default_rng(seed).standard_normal(800), [(0, 800)])
        for seed in range(20)
    ]
    assert all(one is not None and one.share < LEAST_LINE for one in found)


@pytest.mark.parametrize("kept", [0.0, 0.7])
def test_noise_has_an_irregular_autocorrelation(kept: float) -> None:
    irregular = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        values = np.zeros(1500)
        for k in range(1, 1500):
            values[k] = kept * values[k - 1] + rng.standard_normal()
        irregular += regularity(values)[0] < REGULAR
    assert irregular >= 18


def test_a_clean_sine_is_as_regular_as_can_be_told() -> None:
    regular, period = regularity(wave(1.0, 31.0, 900))
    assert regular > 20.0
    assert period == pytest.approx(31.0, rel=0.02)


def test_too_few_cycles_are_none() -> None:
    assert oscillation(wave(1.0, 8.0, 20), [(0, 20)]) is None
    assert oscillation(np.full(900, 3.0), [(0, 900)]) is None
    assert regularity(wave(1.0, 600.0, 900)) == (0.0, 0.0)


@given(st.integers(1, 400), st.floats(-5.0, 5.0))
def test_the_slow_mean_of_a_constant_is_the_constant(count: int, value: float) -> None:
    assert slow_mean(np.full(count, value), 40.0) == pytest.approx(np.full(count, value))


@pytest.mark.parametrize("seed", range(5))
def test_a_cycle_that_keeps_no_exact_time_is_no_smaller(seed: int) -> None:
    turns = 1.0 + 0.1 * np.random.default_rng(seed).standard_normal(40)  # each cycle by a tenth
    ends = np.concatenate([[0.0], np.cumsum(turns * 50.0)])
    values = np.sin(2.0 * np.pi * np.interp(np.arange(1900), ends, np.arange(41.0)))
    found = oscillation(values, [(0, 1900)])
    assert found is not None
    assert found.amplitude == pytest.approx(1.0, rel=0.2)


@given(first=st.integers(0, 500), count=st.integers(1, 2000), period=st.floats(2.0, 300.0))
def test_pieces_hold_every_sample_and_no_other(first: int, count: int, period: float) -> None:
    found = pieces([(first, first + count)], period)
    assert {k for a, b in found for k in range(a, b)} == set(range(first, first + count))
    assert all(b - a <= (NEEDED_CYCLES + 0.5) * period + 1.0 for a, b in found)
