"""Enumeration is complete, and its best cell is the best of any point nearby."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops
from hypothesis import assume, given
from hypothesis import strategies as st
from samples import stems

from stiction_ros.effects import FloatArray
from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.exact.neighbourhood import neighbourhood, refine
from stiction_ros.identification.exact.pattern_search import PatternSearch, nearby_delays, points_of
from stiction_ros.identification.problem.models import (
    Criterion,
    Data,
    Model,
    linear_model,
    with_valve,
)
from stiction_ros.identification.problem.preparation import prepare, window
from stiction_ros.identification.switching import (
    Beginning,
    StepSignals,
    beginning_of,
    cells_at,
    levels_with,
)


@pytest.fixture(scope="module")
def near_truth() -> tuple[Data, Model]:
    """Return Example 1 with a friction a little beside the truth."""
    record = loops.example1(1, "equation")
    data = prepare(record, IdentificationOptions(output_order=3, input_order=3))
    orders = window(IdentificationOptions(output_order=3, input_order=3), 3, 3)
    linear = linear_model(data, orders)
    friction = np.array([5.02, 1.97])
    return data, with_valve(data, linear, 0, friction, 0.0, np.array([5]))


def search_of(near_truth: tuple[Data, Model]) -> PatternSearch:
    data, model = near_truth
    level = PatternSearch(data, model, 0, 0).best_level(model.friction[0])
    begin = beginning_of(data.u[0], level, float(model.friction[0, 0]))
    return PatternSearch(data, model, 0, 0, begin)


def extreme_slips(u: FloatArray) -> list[Beginning]:
    """Return three first slips at the largest steps of OP beyond all that it was."""
    beyond = np.diff(np.maximum.accumulate(u)) - np.diff(np.minimum.accumulate(u))
    rows = np.sort(np.argsort(-beyond, kind="stable")[:3]) + 1
    return [Beginning(float(u[0]), int(k), float(np.sign(u[k] - u[0]))) for k in rows]


def test_enumerated_cells_fill_the_rectangle(near_truth: tuple[Data, Model]) -> None:
    search = search_of(near_truth)
    assert search.begin is not None
    rectangle = np.array([2.95, 3.05, 6.95, 7.05])
    found = search.enumerate(search.begin, rectangle[None, :], 5000)
    assert found is not None
    jl, jh, sl, sh = np.clip(found.bounds, rectangle[[0, 0, 2, 2]], rectangle[[1, 1, 3, 3]]).T
    corners = np.unique(np.round(np.column_stack([jl, jh, sl, sh]), 12), axis=0)
    area = ((corners[:, 1] - corners[:, 0]) * (corners[:, 3] - corners[:, 2])).sum()
    assert area == pytest.approx(0.01, rel=1e-6)
    assert search.enumerate(search.begin, rectangle[None, :], 2) is None


@given(jump=st.floats(0.5, 6.0), more=st.floats(0.2, 6.0), slip=st.integers(0, 2))
def test_a_friction_and_a_start_have_the_pattern_of_their_cell(
    near_truth: tuple[Data, Model], jump: float, more: float, slip: int
) -> None:
    data, model = near_truth
    begin = extreme_slips(data.u[0, :300])[slip]
    search = PatternSearch(data, model, 0, 0, begin, Criterion.ONE_STEP)
    scan = search.evaluate(cells_at(search.u, begin, np.array([[jump, jump + more]])))
    friction, start = search.realised(scan, 0, begin)
    assume(friction[0] > 0.5 * np.ptp(search.u[: begin.first]))  # else it slipped before
    again = beginning_of(search.u, float(search.u[0]) + start, float(friction[0]))
    assert again.slips_alike(begin)
    assert (cells_at(search.u, again, points_of(friction[None, :])).bounds == scan.bounds).all()


@given(seed=st.integers(0, 10_000), static=st.floats(0.2, 5.0), share=st.floats(-0.99, 0.99))
def test_levels_of_a_first_slip_are_those_from_which_it_comes(
    seed: int, static: float, share: float
) -> None:
    u = np.random.default_rng(seed).standard_normal(200).cumsum()
    level = float(u[0]) + share * static
    begin = beginning_of(u, level, static)
    assume(0 < begin.first < len(u))
    ((low, high),) = levels_with(u, static, begin)
    assert low - 1e-9 <= level <= high + 1e-9
    for inside in np.linspace(low, high, 5)[1:-1]:
        assert beginning_of(u, float(inside), static).slips_alike(begin)


def test_no_friction_beyond_the_limit_is_taken(near_truth: tuple[Data, Model]) -> None:
    data, model = near_truth
    narrow = dataclasses.replace(data, limit=np.array([4.5]))
    begin = extreme_slips(data.u[0, :300])[0]
    search = PatternSearch(narrow, model, 0, 0, begin, Criterion.ONE_STEP)
    points = np.array([[0.01, 8.9], [0.5, 8.4], [2.0, 6.9], [4.4, 4.5]])
    scan = search.evaluate(cells_at(search.u, begin, points))
    for index in range(len(points)):
        assert search.realised(scan, index, begin)[0][0] <= 4.5


def test_cells_that_are_known_are_not_listed_again(near_truth: tuple[Data, Model]) -> None:
    search, friction = search_of(near_truth), np.array([5.0, 2.0])
    assert search.begin is not None
    fresh = neighbourhood(search, search.begin, friction, 1.0, 3000)
    again = neighbourhood(search, search.begin, friction, 1.0, 3000, before=fresh)
    assert fresh.closed
    assert again.closed
    assert (again.cells.bounds == fresh.cells.bounds).all()
    assert again.scan.loss == pytest.approx(fresh.scan.loss, rel=1e-12)
    later = dataclasses.replace(search.begin, first=search.begin.first + 1)
    other = neighbourhood(search, later, friction, 1.0, 3000, before=fresh)
    apart = neighbourhood(search, later, friction, 1.0, 3000)
    assert (other.cells.bounds == apart.cells.bounds).all()


@given(jump=st.floats(2.951, 3.049), reverse=st.floats(6.951, 7.049))
def test_no_point_of_the_rectangle_beats_its_cells(
    near_truth: tuple[Data, Model], jump: float, reverse: float
) -> None:
    search = search_of(near_truth)
    assert search.begin is not None
    found = search.enumerate(search.begin, np.array([[2.95, 3.05, 6.95, 7.05]]), 5000)
    assert found is not None
    cells = cells_at(search.u, search.begin, np.array([[jump, reverse]]))
    f_d = 0.5 * (reverse - jump)
    stem = stems(cells, f_d)
    scan = search.scans[0]
    point = scan.count * float(
        np.log(scan.least_energy(StepSignals.of(stem))[0].min() / scan.count)
    )
    assert search.evaluate(found).loss.min() <= point + 1e-6


def test_refinement_ends_at_the_truth(near_truth: tuple[Data, Model]) -> None:
    data, model = near_truth
    better, reachable = refine(data, model, 0, 8.0)
    assert better.loss < model.loss - 5.0
    assert better.friction[0] == pytest.approx([5.0, 2.0], abs=0.03)
    assert reachable is not None
    assert reachable.closed
    truth = points_of(np.array([[5.0, 2.0]]))[0]
    assert (reachable.rectangle[[0, 2]] <= truth).all()
    assert (reachable.rectangle[[1, 3]] >= truth).all()


def test_valve_without_friction_is_left_alone(near_truth: tuple[Data, Model]) -> None:
    data, model = near_truth
    linear = linear_model(data, model.orders)
    assert refine(data, linear, 0, 8.0) == (linear, None)


def test_nearby_delays_stay_in_the_range(near_truth: tuple[Data, Model]) -> None:
    data, model = near_truth
    assert nearby_delays(data, model, 0, 1) == ((4, 6),)
    assert nearby_delays(data, model, 0, 20) == ((0, 10),)
    assert nearby_delays(data, model, 0, None) == ((0, 10),)
