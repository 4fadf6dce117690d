"""How slips, turns, regularity and causes are read."""

import numpy as np
import pytest

from stiction_studies.field.truth import Cause, Swings, causes, regularity, slips, swing
from stiction_studies.field.valves import Ramped


def test_slips_are_moves_between_stands() -> None:
    stem = np.array([50.0, 50, 51, 52, 52, 52, 54, 54, 54, 52, 50, 50, 50.05, 50.05])
    starts, turned = slips(stem, Ramped(band=4.0, jump=2.0))
    assert starts == [1, 5, 8]
    assert turned == 1


def test_an_even_motion_counts_its_ways() -> None:
    stem = 50.0 + 5.0 * np.sin(2.0 * np.pi * np.arange(400) / 100.0)
    starts, turned = slips(stem, Ramped(band=2.0, jump=0.0))
    assert len(starts) == 9
    assert turned == 8


def test_a_little_noise_turns_no_stem() -> None:
    stem = 50.0 + 0.04 * np.random.default_rng(0).standard_normal(300)
    assert slips(stem, Ramped(band=4.0, jump=0.0)) == ([], 0)


def test_without_friction_nothing_slips() -> None:
    assert slips(np.arange(5.0), Ramped(0.0, 0.0)) == ([], 0)


def test_a_wave_is_regular_and_noise_is_not() -> None:
    time = np.arange(900)
    noise = np.random.default_rng(3).standard_normal(900)
    regular, period = regularity(np.sin(time / 7.0) + 0.3 * noise)
    assert regular > 1.0
    assert period == pytest.approx(14.0 * np.pi, rel=0.05)
    assert regularity(noise)[0] < 1.0
    assert regularity(np.cumsum(noise))[0] < 1.0


def test_what_is_slower_than_two_periods_does_not_count() -> None:
    time = np.arange(2000.0)
    wave = np.sin(2.0 * np.pi * time / 20.0)
    assert swing(wave + 1e-2 * time, 20.0) == pytest.approx(np.sqrt(0.5), rel=0.05)


def test_the_cause_is_what_the_swing_goes_away_with() -> None:
    wave = np.sin(np.arange(900) / 7.0)
    noise = 0.1 * np.random.default_rng(0).standard_normal(900)
    swinging, quiet = Swings(wave + noise, wave + noise), Swings(noise, noise)
    without = {Cause.VALVE: quiet, Cause.DISTURBANCE: swinging}
    assert causes(swinging, without) == {Cause.VALVE}
    # Two that each keep it going alone are both right.
    both = {Cause.VALVE: swinging, Cause.TUNING: swinging}
    assert causes(swinging, both) == {Cause.VALVE, Cause.TUNING}
    assert causes(quiet, {Cause.DISTURBANCE: quiet}) == {Cause.NONE}
    assert causes(quiet, {}) == {Cause.NONE}
    # A valve that makes OP wander, and PV not, is the cause without a cycle.
    assert causes(Swings(noise, wave), {Cause.VALVE: quiet}) == {Cause.VALVE, Cause.NONE}
