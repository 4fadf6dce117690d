"""Cells hold exactly the frictions with one switching pattern, and tile the plane."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples import bases, dense, stems

from stiction_ros.effects import FloatArray, HeStiction, KanoStiction
from stiction_ros.identification.friction import simulate
from stiction_ros.identification.switching import (
    StepSignals,
    beginning_of,
    cells_at,
    levels_of,
    resting_cells,
    stem_steps,
)

seeds = st.integers(0, 10_000)


def random_walk(seed: int, samples: int = 300) -> FloatArray:
    return np.random.default_rng(seed).standard_normal(samples).cumsum()


def simulated(u: FloatArray, static: float, dynamic: float, level: float) -> FloatArray:
    return HeStiction.simulate_grid(np.array([[static, dynamic]]), u, level)[:, 0]


@given(seed=seeds, static=st.floats(0.05, 5.0), share=st.floats(0.0, 1.0), level=st.floats(-3, 3))
def test_pattern_gives_the_stem_of_the_law(
    seed: int, static: float, share: float, level: float
) -> None:
    u, dynamic = random_walk(seed), share * static
    point = np.array([[static - dynamic, static + dynamic]])
    cells = resting_cells(u, np.full(3, level), np.repeat(point, 3, axis=0))
    found = stems(cells, dynamic)
    assert found.shape == (len(u), 3)
    assert np.abs(found.T - simulated(u, static, dynamic, level)).max() < 1e-9


@given(seed=seeds, jump=st.floats(0.1, 4.0), more=st.floats(0.1, 4.0), place=st.floats(0.01, 0.99))
def test_friction_inside_a_cell_has_its_pattern_and_none_outside(
    seed: int, jump: float, more: float, place: float
) -> None:
    u = random_walk(seed)
    begin = beginning_of(u, float(u[0]), 0.5)
    cell = cells_at(u, begin, np.array([[jump, jump + more]]))
    jl, jh, sl, sh = cell.bounds[0]
    assert jl <= jump <= jh
    assert sl <= jump + more <= sh
    high = np.minimum([jh, sh], [jump + 1.0, jump + more + 1.0])
    inner = np.array([jl, sl]) + place * (high - [jl, sl])
    assert (bases(cells_at(u, begin, inner[None, :])) == bases(cell)).all()
    for outer in ([jl - 1e-6, inner[1]], [inner[0], sl - 1e-6]):
        if min(outer) > 0.0:
            assert (bases(cells_at(u, begin, np.array([outer]))) != bases(cell)).any()
    for outer in ([jh + 1e-6, inner[1]], [inner[0], sh + 1e-6]):
        if np.isfinite(outer).all():
            assert (bases(cells_at(u, begin, np.array([outer]))) != bases(cell)).any()


@given(seed=seeds, static=st.floats(0.5, 5.0))
def test_levels_tile_the_band_and_share_the_first_slip(seed: int, static: float) -> None:
    u = random_walk(seed, 120)
    ranges = np.sort(levels_of(u, static, 1000), axis=0)
    assert ranges[0, 0] == pytest.approx(u[0] - static)
    assert ranges[-1, 1] == pytest.approx(u[0] + static)
    assert ranges[1:, 0] == pytest.approx(ranges[:-1, 1])
    for low, high in ranges:
        ends = [beginning_of(u, low + share * (high - low), static) for share in (0.1, 0.9)]
        assert ends[0].first == ends[1].first
        assert ends[0].direction == ends[1].direction


def test_valve_that_never_slips_has_no_first_slip() -> None:
    begin = beginning_of(np.zeros(50), 0.0, 1.0)
    assert (begin.first, begin.direction) == (50, 0.0)


SIZES = st.integers(0, 3)
GRID = np.array([[0.0, 0.0], [0.3, 0.1], [1.0, 1.0], [2.5, 0.5], [90.0, 1.0]])


@given(seed=st.integers(0, 10_000), samples=st.integers(1, 130), start=st.floats(-3.0, 3.0))
@pytest.mark.parametrize("law", [HeStiction, KanoStiction])
def test_moves_give_the_stem_of_the_law(
    law: type[HeStiction] | type[KanoStiction], seed: int, samples: int, start: float
) -> None:
    u = np.random.default_rng(seed).standard_normal(samples).cumsum()
    steps = stem_steps(law, GRID, u, start)
    stems = simulate(law, GRID, u, start)
    assert (dense(steps, 0) == stems).all()
    assert (steps.moves == np.count_nonzero(np.diff(stems, axis=0), axis=0)).all()


@given(seed=st.integers(0, 10_000), samples=st.integers(1, 40), size=st.integers(0, 3))
def test_dense_signals_come_back(seed: int, samples: int, size: int) -> None:
    generator = np.random.default_rng(seed)
    one, two = generator.integers(0, 2, (2, samples, size)).astype(float)
    steps = StepSignals.of(one, two)
    assert (steps.size, steps.count) == (size, samples)
    assert (dense(steps, 0) == one).all()
    assert (dense(steps, 1) == two).all()
    assert (steps.moves == np.count_nonzero(np.diff(one, axis=0), axis=0)).all()


@given(seed=st.integers(0, 10_000), samples=st.integers(1, 40), sizes=st.tuples(*3 * [SIZES]))
def test_joined_signals_are_those_of_the_parts(
    seed: int, samples: int, sizes: tuple[int, ...]
) -> None:
    generator = np.random.default_rng(seed)
    parts = [generator.integers(0, 2, (samples, size)).astype(float) for size in sizes]
    joined = StepSignals.joined([StepSignals.of(part) for part in parts])
    assert (dense(joined, 0) == np.hstack(parts)).all()


@given(seed=st.integers(0, 10_000), samples=st.integers(1, 40), chosen=st.lists(st.integers(0, 4)))
def test_chosen_signals_are_those_asked_for(seed: int, samples: int, chosen: list[int]) -> None:
    every = np.random.default_rng(seed).integers(0, 2, (samples, 5)).astype(float)
    steps = StepSignals.of(every, 2.0 * every).chosen(np.array(chosen, dtype=np.int64))
    assert (dense(steps, 0) == every[:, chosen]).all()
    assert (dense(steps, 1) == 2.0 * every[:, chosen]).all()
