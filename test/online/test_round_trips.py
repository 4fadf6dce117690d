import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.round_trips import LATE, OPEN, RoundTrips, TickGrid

PERIOD = 0.01


def asked(seconds: list[float]) -> RoundTrips:
    trips = RoundTrips()
    for stamp, time in enumerate(seconds):
        trips.ask(stamp, 100.0)
        trips.answer(stamp, 100.0 + time)
    return trips


@given(st.lists(st.floats(1e-5, 100.0), min_size=1, max_size=300))
def test_figures_are_those_of_all_samples(seconds):
    found = asked(seconds).milliseconds()
    for name, share in (("p50", 50), ("p99", 99), ("p999", 99.9)):
        exact = 1e3 * float(np.percentile(seconds, share, method="inverted_cdf"))
        assert np.isclose(found[name], exact, rtol=1e-6)
    assert np.isclose(found["max"], 1e3 * max(seconds), rtol=1e-6)


def test_only_the_first_answer_counts_and_strangers_do_not():
    trips = RoundTrips()
    trips.answer(7, 1.0)
    trips.ask(1, 1.0)
    trips.ask(1, 5.0)
    trips.answer(1, 1.5)
    trips.answer(1, 9.0)
    assert (trips.asked, trips.answered, trips.longest) == (1, 1, 0.5)


def test_samples_without_an_answer_do_not_pile_up():
    trips = RoundTrips()
    for stamp in range(3 * OPEN):
        trips.ask(stamp, float(stamp))
    assert len(trips._open) == OPEN
    assert trips.milliseconds() == {}
    assert trips.asked == 3 * OPEN


def ticks(lateness: list[float]) -> tuple[list[float], TickGrid]:
    """Return when ticks came on a timer that is late by so much each time, as rcl's fires."""
    grid, due, found = TickGrid(), PERIOD, list[float]()
    grid.begin(PERIOD, 0.0)
    for late in lateness:
        now = max(due, found[-1] if found else 0.0) + late
        found.append(now)
        due += PERIOD
        if grid.tick(now):
            due = now + PERIOD
    return found, grid


@given(st.lists(st.floats(0.0, 5 * PERIOD), max_size=60))
def test_no_two_ticks_are_closer_than_half_a_period(lateness: list[float]) -> None:
    found, _grid = ticks(lateness)
    for one, other in itertools.pairwise(found):
        assert other - one >= (1.0 - LATE) * PERIOD - 1e-12


@given(st.lists(st.floats(0.0, LATE * PERIOD * 0.999), max_size=60))
def test_a_little_lateness_does_not_add_up(lateness: list[float]) -> None:
    found, grid = ticks(lateness)
    assert grid.missed == 0
    for count, now in enumerate(found, start=1):
        assert now <= (count + LATE) * PERIOD + 1e-12


def test_what_is_lost_by_late_ticks_is_counted_in_whole_periods() -> None:
    _found, grid = ticks([0.0, 0.6 * PERIOD, 0.0, 0.6 * PERIOD, 2.5 * PERIOD])
    assert int(grid.missed) == 3
