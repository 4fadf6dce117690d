"""Polygons hold exactly the frictions with one pattern of the semi-physical law, and tile."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.effects import FloatArray, SemiPhysicalStiction
from stiction_ros.identification.switching.polygons import (
    PolygonCell,
    area,
    cut,
    enumerate_cells,
    region,
    trace,
)

seeds = st.integers(0, 10_000)


def slow_walk(seed: int, samples: int = 150) -> FloatArray:
    return np.random.default_rng(seed).standard_normal(samples).cumsum()


@settings(max_examples=60, deadline=None)
@given(
    seed=seeds,
    static=st.floats(0.3, 5.0),
    share=st.floats(0.0, 1.0),
    level=st.floats(-3.0, 3.0),
    overshoot=st.floats(1.0, 2.0),
)
def test_pattern_gives_the_stem_of_the_law(
    seed: int, static: float, share: float, level: float, overshoot: float
) -> None:
    u, dynamic = slow_walk(seed), share * static
    seen = trace(u, np.array([static, dynamic]), overshoot, level)
    stem = SemiPhysicalStiction(static, dynamic, overshoot).simulate(u, level)
    assert seen.alpha - seen.beta * dynamic + seen.gamma * level == pytest.approx(stem, abs=1e-8)
    rows, ends = seen.half_planes(level)
    assert (rows @ [static, dynamic] <= ends + 1e-8).all()
    low, high = seen.levels(np.array([static, dynamic]))
    assert low - 1e-8 <= level <= high + 1e-8


def cells_near(seed: int) -> tuple[FloatArray, FloatArray, list[PolygonCell]]:
    u = slow_walk(seed)
    corners = region(np.array([1.5, 0.6]), np.array([0.05, 0.05]), 10.0)
    cells = enumerate_cells(u, corners, 1.99, float(u[0]), 20_000)
    assert cells is not None
    return u, corners, cells


@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_polygons_tile_the_region_and_keep_their_pattern(seed: int) -> None:
    u, corners, cells = cells_near(seed)
    assert sum(area(cell.corners) for cell in cells) == pytest.approx(area(corners), rel=1e-6)
    generator = np.random.default_rng(seed)
    for cell in cells[:20]:
        inside = generator.dirichlet(np.ones(len(cell.corners))) @ cell.corners
        assert (trace(u, inside, 1.99, float(u[0])).slip == cell.trace.slip).all()
        low, high = cell.static_range(float(inside[1]))
        assert low - 1e-12 <= inside[0] <= high + 1e-12


def test_one_step_beyond_the_range_of_levels_the_pattern_is_another() -> None:
    u, friction = slow_walk(5), np.array([1.5, 0.6])
    seen = trace(u, friction, 1.99, float(u[0]))
    low, high = seen.levels(friction)
    assert (trace(u, friction, 1.99, low + 1e-9).slip == seen.slip).all()
    assert (trace(u, friction, 1.99, high - 1e-9).slip == seen.slip).all()
    assert (trace(u, friction, 1.99, low - 1e-9).slip != seen.slip).any()
    assert (trace(u, friction, 1.99, high + 1e-9).slip != seen.slip).any()


def test_more_cells_than_allowed_are_refused() -> None:
    u, corners, cells = cells_near(1)
    assert enumerate_cells(u, corners, 1.99, float(u[0]), len(cells) - 1) is None


def test_a_cut_parts_a_square() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    inside, outside = cut(square, np.array([1.0, 0.0]), 0.25)
    assert (area(inside), area(outside)) == (0.25, 0.75)
    assert area(cut(square, np.array([1.0, 0.0]), 2.0)[1]) == 0.0


def test_regions_end_at_the_triangle() -> None:
    corners = region(np.array([1.0, 0.9]), np.array([0.5, 0.5]), 1.2)
    assert corners[:, 0].max() == pytest.approx(1.2)
    assert (corners[:, 1] <= corners[:, 0] + 1e-12).all()
