"""Grids stay inside the triangle; switching bounds keep the pattern."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.identification.friction_grid import (
    around,
    coarse_grid,
    find_law,
    simulate,
    switching_bounds,
)


@given(limit=st.floats(0.1, 200.0))
def test_coarse_grid_fills_the_triangle(limit: float) -> None:
    grid = coarse_grid(limit)
    assert (grid[:, 1] <= grid[:, 0] + 1e-9).all()
    assert grid[:, 0].min() > 0.0
    assert np.isclose(grid[:, 0].max(), limit)


@given(static=st.floats(0.0, 10.0), dynamic=st.floats(0.0, 10.0), step=st.floats(0.01, 3.0))
def test_local_grid_stays_in_the_triangle(static: float, dynamic: float, step: float) -> None:
    grid = around(np.array([[static, min(static, dynamic)]]), step, 10.0)
    assert (grid[:, 1] <= grid[:, 0]).all()
    assert (grid[:, 0] <= 10.0).all()
    assert (grid >= 0.0).all()


@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    static=st.floats(0.2, 5.0),
    share=st.floats(0.0, 1.0),
    place=st.floats(0.001, 0.999),
)
def test_friction_between_the_bounds_moves_the_stem_alike(
    seed: int, static: float, share: float, place: float
) -> None:
    u = np.random.default_rng(seed).standard_normal(200).cumsum()
    law = find_law("he")
    grid = np.array([[static, share * static]])
    start = u[:1]
    stems = simulate(law, grid, u, start)
    stayed, slipped = switching_bounds(stems, u, start, grid[:, 0])
    assert stayed[0] <= static <= slipped[0]
    top = min(float(slipped[0]), static + 1.0)
    other = np.array([[float(stayed[0]) + place * (top - float(stayed[0])), grid[0, 1]]])
    assert (simulate(law, other, u, start) == stems).all()
