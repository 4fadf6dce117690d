"""Cells of a beginning are divided exactly, and needles that all grids step over are found."""

import dataclasses
import itertools

import numpy as np
import pytest
import simulated_loops as loops
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import FloatArray, HeStiction
from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.exact.growing_patterns import (
    Branch,
    cross,
    divided,
    first_branch,
    first_slips,
    growing_patterns,
    spread,
    thinned,
    window_lengths,
)
from stiction_ros.identification.exact.pattern_search import PatternSearch, area
from stiction_ros.identification.exact.search import search
from stiction_ros.identification.problem.models import Criterion, Data, Model, linear_model
from stiction_ros.identification.problem.preparation import prepare, window
from stiction_ros.identification.switching import Beginning, beginning_of, cells_at
from stiction_studies.examples import example2


def random_walk(seed: int, samples: int = 200) -> FloatArray:
    return np.random.default_rng(seed).standard_normal(samples).cumsum()


@pytest.fixture(scope="module")
def loop() -> tuple[Data, Model]:
    """Return the first 600 samples of Example 1 and a model without friction."""
    record = loops.example1(1, "equation", samples=600)
    options = IdentificationOptions(output_order=3, input_order=3, delay=(4, 6))
    data = prepare(record, options)
    return data, linear_model(data, window(options, 3, 3))


def on_window(loop: tuple[Data, Model], count: int, begin: Beginning) -> PatternSearch:
    data, model = loop
    part, shown = data.part(0, count), model.beginning(count)
    return PatternSearch(part, shown, 0, begin=begin, criterion=Criterion.ONE_STEP)


def branch_at(loop: tuple[Data, Model], count: int, point: FloatArray) -> Branch:
    begin = beginning_of(loop[0].u[0], float(loop[0].u[0, 0]), 5.0)
    search = on_window(loop, count, begin)
    scan = search.evaluate(cells_at(search.u, begin, point[None, :]))
    return Branch(search, begin, scan)


@given(jump=st.floats(0.3, 6.0), more=st.floats(0.5, 6.0), longer=st.integers(210, 400))
def test_cells_of_a_longer_window_fill_the_cell_they_come_from(
    loop: tuple[Data, Model], jump: float, more: float, longer: int
) -> None:
    branch = branch_at(loop, 200, np.array([jump, jump + more]))
    square = np.array([jump - 0.2, jump + 0.2, jump + more - 0.2, jump + more + 0.2])
    whole = np.clip(branch.scan.bounds, square[[0, 0, 2, 2]], square[[1, 1, 3, 3]])
    branch = dataclasses.replace(branch, scan=dataclasses.replace(branch.scan, bounds=whole))
    found = divided(branch, on_window(loop, longer, branch.begin)).scan.bounds
    inside = np.clip(found, whole[0, [0, 0, 2, 2]], whole[0, [1, 1, 3, 3]])
    assert len(np.unique(found, axis=0)) == len(found)
    assert area(inside) == pytest.approx(area(whole), rel=1e-9)


@given(seed=st.integers(0, 10_000), static=st.floats(0.2, 5.0), share=st.floats(-0.9, 0.9))
def test_a_valve_slips_first_where_op_goes_beyond_all_it_was(
    seed: int, static: float, share: float
) -> None:
    u = random_walk(seed)
    begin = beginning_of(u, float(u[0]) + share * static, static)
    found = {slip.first: slip.direction for slip in first_slips(u)}
    assert len(found) <= 3
    for first, direction in found.items():
        assert direction * u[first] > (direction * u[:first]).max()
    if begin.first < len(u):
        assert begin.direction * u[begin.first] > (begin.direction * u[: begin.first]).max()
        step = np.concatenate([u[: begin.first + 1], np.full(20, u[begin.first])])
        step[begin.first :] += 30.0 * begin.direction
        assert begin.first in {slip.first for slip in first_slips(step)}


def test_op_that_rests_has_no_first_slip() -> None:
    assert first_slips(np.zeros(50)) == []


def test_a_record_whose_op_rests_at_first_keeps_its_model(loop: tuple[Data, Model]) -> None:
    data, model = loop
    still = dataclasses.replace(data, u=np.where(np.arange(600) < 590, 0.0, data.u))
    assert growing_patterns(still, model, 0) is model


def test_lines_cross_in_the_middle() -> None:
    lines = cross(np.array([[1.0, 3.0, 8.0, np.inf]]), 5.0)
    assert lines[0] == pytest.approx([2.0, 2.0, 0.0, 10.0], abs=1e-5)
    assert lines[1] == pytest.approx([0.0, 10.0, 9.0, 9.0], abs=1e-5)
    assert (lines[:, [1, 3]] > lines[:, [0, 2]]).all()


def test_few_cells_are_kept_from_the_same_place(loop: tuple[Data, Model]) -> None:
    begin = beginning_of(loop[0].u[0], float(loop[0].u[0, 0]), 5.0)
    branch = first_branch(on_window(loop, 200, begin), begin)
    best = spread(branch.scan, 1.0, 20, 2)
    squares = np.floor(branch.scan.bounds[best][:, [0, 2]])
    _, held = np.unique(squares, axis=0, return_counts=True)
    assert len(best) == 20
    assert held.max() == 2
    assert best[0] == branch.scan.loss.argmin()
    assert (np.diff(branch.scan.loss[best]) >= 0.0).all()


def test_thinned_branches_keep_their_own_cells(loop: tuple[Data, Model]) -> None:
    begin = beginning_of(loop[0].u[0], float(loop[0].u[0, 0]), 5.0)
    other = dataclasses.replace(begin, first=begin.first + 1)
    branches = [first_branch(on_window(loop, 200, slip), slip) for slip in (begin, other)]
    kept = thinned(branches, 1.0)
    assert sum(len(branch.scan.loss) for branch in kept) <= 60
    for branch in kept:
        whole = next(one for one in branches if one.begin == branch.begin)
        assert np.isin(branch.scan.loss, whole.scan.loss).all()
    least = min(branch.scan.loss.min() for branch in branches)
    assert min(branch.scan.loss.min() for branch in kept) == least


def test_windows_grow_up_to_the_whole_record() -> None:
    assert window_lengths(100, 100) == [100]
    lengths = window_lengths(100, 300)
    assert lengths[0] == 100
    assert lengths[-1] == 300
    assert all(b <= int(1.2 * a) + 1 for a, b in itertools.pairwise(lengths))


@pytest.mark.trial
@pytest.mark.parametrize(("plant", "seed"), [("tank", 54), ("tank", 135), ("linear", 68)])
def test_a_needle_that_the_grids_step_over_is_found(plant: str, seed: int) -> None:
    example = example2(seed, plant, samples=620)
    data = prepare(example.record, example.options)
    orders = window(example.options, 2, 2)
    linear = linear_model(data, orders)
    by_grids, _ = search(data, linear, growing=False)
    found = growing_patterns(data, linear, 0)
    assert np.abs(by_grids.friction[0] - [8.0, 1.0]).max() > 0.15
    assert found.friction[0] == pytest.approx([8.0, 1.0], abs=0.15)
    assert found.loss < by_grids.loss - 100.0


def test_nothing_is_gained_where_there_is_no_friction() -> None:
    generator = np.random.default_rng(5)
    u = generator.standard_normal(400).cumsum()
    y = np.zeros(400)
    for k in range(1, 400):
        y[k] = 0.8 * y[k - 1] + 0.3 * u[k - 1] + 1e-3 * generator.standard_normal()
    data = Data(
        y=((y - y.mean()) / y.std())[None, :],
        u=(u - u.mean())[None, :],
        law=HeStiction,
        limit=np.array([np.ptp(u)]),
        delay=(0, 0),
    )
    orders = window(IdentificationOptions(output_order=1, input_order=1, delay=(0, 0)), 1, 1)
    model = linear_model(data, orders)
    assert growing_patterns(data, model, 0).loss > model.loss - 10.0
