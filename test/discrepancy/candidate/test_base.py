"""What all candidates share: coordinates of the search, and points apart from each other."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.decision.scores import all_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Axis, Backlash, Slew

AXES = (Axis(0.1, 20.0, 24, logarithmic=True), Axis(-1.0, 1.0, 5))
RUN = FreeRun(loop(), open_gate(loop(), [record(loop(), samples=200)])[0])
CANDIDATE = ValveCandidate.at(RUN, 0, Backlash, AXES)


@given(st.floats(0.1, 20.0), st.floats(-1.0, 1.0))
def test_coordinates_and_values_undo_each_other(first: float, second: float) -> None:
    point = np.array([first, second])
    there = CANDIDATE.coordinates(point)
    assert CANDIDATE.values(there[None, :])[0] == pytest.approx(point, rel=1e-12)


@given(st.integers(0, 1000), st.integers(1, 6))
def test_points_apart_are_no_neighbours_and_the_best_is_first(seed: int, most: int) -> None:
    grid = CANDIDATE.grid()
    loss = np.random.default_rng(seed).random(len(grid))
    chosen = CANDIDATE.apart(grid, loss, most)
    steps = np.array([axis.spacing for axis in AXES])
    places = np.rint((grid[chosen] - grid[0]) / steps)
    away = np.abs(places[:, None] - places[None, :]).max(axis=2)
    np.fill_diagonal(away, np.inf)
    assert chosen[0] == int(np.argmin(loss))
    assert len(chosen) == most
    assert away.min() >= 2


def test_of_equally_good_points_the_first_of_the_grid_is_taken() -> None:
    grid = CANDIDATE.grid()
    assert CANDIDATE.apart(grid, np.zeros(len(grid)), 3) == [0, 2, 4]


def test_a_candidate_stands_for_what_is_not_told_from_it_too() -> None:
    candidate = CANDIDATE.or_else("process:PV1", "pole")
    assert candidate.keys == (("valve:V1", "backlash"), ("process:PV1", "pole"))
    assert CANDIDATE.keys == (("valve:V1", "backlash"),)


def test_candidates_are_values_with_an_identity() -> None:
    for candidate in all_candidates(Baseline.of(RUN)):
        with pytest.raises(dataclasses.FrozenInstanceError):
            candidate.twins = ()  # type: ignore[misc]
    beside = RUN.model.with_effect("valve:V1", Slew(2.0))
    run = FreeRun(beside, RUN.runs)
    now, then = all_candidates(Baseline.of(RUN)), all_candidates(Baseline.of(run))
    names = [each.name for each in now]
    assert len(set(names)) == len(names)
    assert {each.name for each in then} == set(names)
