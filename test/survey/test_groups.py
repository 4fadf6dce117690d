import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import entry

from stiction_ros.survey.entry import Cycling, Entry, Status
from stiction_ros.survey.groups import beats, grouped, locked, ranked

DAY = 1.7e9
SHARES = st.floats(0.0, 1.0)


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


@st.composite
def entries(draw: st.DrawFn) -> list[Entry]:
    count = draw(st.integers(1, 12))
    return [
        entry(
            f"L{k}",
            draw(st.sampled_from(["sticky", "backlash", "undecided", "healthy"])),
            draw(st.sampled_from(["valve", "tuning", "disturbance", "none"])),
            probability=draw(SHARES),
            band_share=draw(SHARES),
        )
        for k in range(count)
    ]


@given(entries(), st.randoms())
def test_the_order_in_which_loops_come_does_not_matter(rows: list[Entry], random: object) -> None:
    mixed = list(rows)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    assert ranked(rows, {}) == ranked(mixed, {})
    assert [row.rank for row in ranked(rows, {})] == list(range(1, len(rows) + 1))


@given(entries())
def test_what_is_found_stands_above_what_is_not(rows: list[Entry]) -> None:
    found = [row.found for row in ranked(rows, {})]
    assert found == sorted(found, reverse=True)


@given(st.floats(0.01, 0.98), st.floats(0.001, 0.01))
def test_the_likelier_and_what_a_service_brings_more_stands_higher(
    share: float, more: float
) -> None:
    one, other = entry("A", probability=share), entry("B", probability=share + more)
    assert [row.name for row in ranked([one, other], {})] == ["B", "A"]
    one, other = (
        entry(name, evidence={"loop_gone": gone})
        for name, gone in (("A", share), ("B", share + more))
    )
    assert [row.name for row in ranked([one, other], {})] == ["B", "A"]


def test_money_counts_where_it_is_known() -> None:
    rows = [entry("A", probability=0.9), entry("B", probability=0.8), entry("C", probability=0.7)]
    order = ranked(rows, {"C": 100.0, "B": 1.0})
    assert order[0].name == "C"
    costs = {row.name: row.cost_per_hour for row in order}
    assert costs["A"] is None
    assert costs["C"] == 100.0 * costs["B"]


def test_what_was_not_judged_stands_last() -> None:
    lost = dataclasses.replace(entry("A"), status=Status.FAILED)
    assert [row.name for row in ranked([lost, entry("B", "healthy", "none")], {})] == ["B", "A"]


def test_an_undecided_valve_stands_between_found_and_healthy_ones() -> None:
    rows = [
        entry("H", "healthy", "disturbance", probability=0.9),
        entry("U", "undecided", "none", probability=0.01),
        entry("V", "undecided", "valve", probability=0.2),
        entry("S", "sticky", "none", probability=0.05),
    ]
    assert [row.name for row in ranked(rows, {})] == ["S", "V", "U", "H"]
