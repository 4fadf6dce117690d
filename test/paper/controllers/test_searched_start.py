import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loops import stable_model, target_at
from paper_cases import LIMITS, STICKY, situation, two_valves, weights

from stiction_ros.effects import HeStiction
from stiction_ros.paper.controllers.augmented_cost import AugmentedCost, PlanProblem
from stiction_ros.paper.controllers.searched_start import SearchedStart

MODEL = two_valves()


@pytest.mark.trial
def test_it_finds_what_a_fine_grid_finds() -> None:
    """One valve, R = 0: two stems, the first held 1, 2 or 3 samples, on a grid of 0.25 %."""
    model = stable_model(5, 2, 1, 1)
    chosen = dataclasses.replace(weights(model, 6), op=np.zeros((1, 1)))
    cost = AugmentedCost(model, chosen, (STICKY,))
    rest, goal = target_at(model, np.array([50.0])), target_at(model, np.array([53.0]))
    at = PlanProblem(rest.state, rest.stem, goal)
    least = np.inf
    for first, second, dwell in itertools.product(
        np.arange(30.0, 70.0, 0.25), np.arange(45.0, 60.0, 0.25), (1, 2, 3)
    ):
        op = np.full((6, 1), 50.0)
        op[0] = first + np.sign(first - 50.0)
        op[1:] = first
        op[dwell] = second + np.sign(second - first)
        op[dwell + 1 :] = second
        least = min(least, cost(at, op))
    found = SearchedStart(cost, LIMITS[:1]).find(at)
    assert found is not None
    assert cost(at, found) <= least


@given(away=st.floats(-40.0, 40.0), stem=st.floats(5.0, 95.0), share=st.floats(0.0, 1.0))
def test_it_costs_no_more_than_resting_and_keeps_the_limits(
    away: float, stem: float, share: float
) -> None:
    frictions = (HeStiction(8.0, 8.0 * share), None)
    cost = AugmentedCost(MODEL, weights(MODEL), frictions)
    at = situation(MODEL, away, stem)
    found = SearchedStart(cost, LIMITS).find(at)
    assert found is not None
    assert found.min() >= 0.0
    assert found.max() <= 100.0
    still = np.tile(at.stem, (len(found), 1))
    assert cost(at, found) <= cost(at, still) * (1 + 1e-6) + 1e-6


def test_stems_nearer_than_the_smallest_jump_go_there_by_a_way_point() -> None:
    cost = AugmentedCost(MODEL, weights(MODEL, 40), (STICKY, None))
    found = SearchedStart(cost, LIMITS).find(situation(MODEL, 4.0))
    assert found is not None
    stems = STICKY.simulate(found[:, 0], start=50.0)
    assert np.count_nonzero(np.diff(stems, prepend=50.0)) == 2
    assert stems[-1] == pytest.approx(54.0, abs=0.3)


def test_two_sticky_valves_move_together() -> None:
    cost = AugmentedCost(MODEL, weights(MODEL, 30), (STICKY, HeStiction(4.0, 1.0)))
    rest = target_at(MODEL, np.array([50.0, 50.0]))
    goal = target_at(MODEL, np.array([60.0, 43.0]))
    found = SearchedStart(cost, LIMITS).find(PlanProblem(rest.state, rest.stem, goal))
    assert found is not None
    assert cost.stems(found, rest.stem)[-1] == pytest.approx(goal.stem, abs=0.5)
