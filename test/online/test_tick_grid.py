"""The grid of ticks: what lies between two of them, and what a late one costs."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.tick_grid import LATE, TickGrid

PERIOD = 0.01


def ticks(lateness: list[float]) -> tuple[list[float], TickGrid]:
    """Return when ticks came on a timer that is late by so much each time, as rcl's fires."""
    grid, due, found = TickGrid(PERIOD, 0.0), PERIOD, list[float]()
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
    assert grid.missed == 3
