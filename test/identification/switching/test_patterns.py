"""Cells hold exactly the frictions with one switching pattern, and tile the plane."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples import bases, stems

from stiction_ros.effects import FloatArray, HeStiction
from stiction_ros.identification.switching.patterns import (
    beginning_of,
    cells_at,
    levels_of,
    resting_cells,
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
