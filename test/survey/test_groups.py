import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import entry

from stiction_ros.survey.beats import beats, locked
from stiction_ros.survey.entry import Cycling, Entry
from stiction_ros.survey.groups import grouped

DAY = 1.7e9


def _cycling(
    name: str, period: float, cause: str, shift: float = 0.0, jitter: float = 0.0
) -> Entry:
    random = np.random.default_rng(len(name))
    at = DAY + shift + period * np.arange(40) + jitter * period * random.standard_normal(40)
    return entry(name, cause=cause, oscillation=Cycling(period, 3.0, 1.0), beats=tuple(at))


def test_beats_are_where_a_cycle_sets_out_upwards() -> None:
    error = np.sin(2 * np.pi * (np.arange(2000) - 13.0) / 50.0)
    found = beats(error, 50.0)
    assert len(found) > 30
    assert found == pytest.approx(13.0 + 50.0 * np.round((found - 13.0) / 50.0), abs=0.6)


def test_beats_keep_their_place_in_noise() -> None:
    random = np.random.default_rng(3)
    error = np.sin(2 * np.pi * np.arange(3000) / 60.0) + 0.3 * random.standard_normal(3000)
    assert np.diff(beats(error, 60.0)) == pytest.approx(60.0, abs=12.0)


@given(st.floats(0.0, 60.0), st.floats(30.0, 600.0))
def test_loops_of_one_time_are_locked_whatever_the_phase(shift: float, period: float) -> None:
    one = period * np.arange(30)
    assert locked(one, one + shift)
    assert locked(one + shift, one)


@given(st.floats(1.02, 1.045))
def test_loops_that_part_are_not(factor: float) -> None:
    one = 60.0 * np.arange(60)
    assert not locked(one, factor * one)


def test_the_valve_that_sticks_comes_first() -> None:
    rows = [
        _cycling("TIC1", 60.0, "disturbance", 11.0, 0.02),
        _cycling("FIC1", 60.0, "valve", 0.0, 0.02),
        _cycling("LIC1", 60.0, "unknown", 31.0, 0.02),
        _cycling("FIC9", 61.7, "valve"),
        entry("quiet", "healthy", "none", oscillation=None),
    ]
    numbered, groups = grouped(rows)
    assert [group.names for group in groups] == [("FIC1", "LIC1", "TIC1")]
    assert groups[0].period == pytest.approx(60.0)
    assert {row.name: row.group for row in numbered} == {
        "TIC1": 1,
        "FIC1": 1,
        "LIC1": 1,
        "FIC9": None,
        "quiet": None,
    }


def test_times_without_dates_compare_within_a_file_alone() -> None:
    one = entry("A", beats=tuple(60.0 * np.arange(30)))
    other = entry("B", beats=tuple(60.0 * np.arange(30)))
    assert grouped([one, other])[1] == []
