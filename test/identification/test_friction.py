"""Grids stay inside the triangle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import FloatArray
from stiction_ros.identification.friction import coarse_grid, cross_grid, even_grid, finer_grid


def inside(grid: FloatArray, limit: float) -> bool:
    static, dynamic = grid.T
    return bool(
        (dynamic <= static + 1e-9).all()
        and (dynamic >= -1e-9).all()
        and (static <= limit * (1.0 + 1e-9)).all()
    )


@given(limit=st.floats(0.1, 200.0))
def test_grids_of_the_whole_triangle_stay_in_it(limit: float) -> None:
    assert coarse_grid(limit)[:, 0].min() > 0.0
    assert np.isclose(coarse_grid(limit)[:, 0].max(), limit)
    for grid in (coarse_grid(limit), even_grid(limit, 20)):
        assert len(grid) > 100
        assert inside(grid, limit)


@given(static=st.floats(0.0, 10.0), share=st.floats(0.0, 1.0), step=st.floats(0.01, 3.0))
def test_grids_round_a_point_stay_in_the_triangle(static: float, share: float, step: float) -> None:
    point = np.array([static, share * static])
    assert inside(finer_grid(point[None, :], step, 10.0), 10.0)
    assert inside(cross_grid(point, point + 1.0, 10.0, 50), 10.0)


def test_finer_grid_is_even_in_jump_and_reverse() -> None:
    grid = finer_grid(np.array([[5.0, 2.0]]), 0.1, 20.0, half=1)
    jump, reverse = grid[:, 0] - grid[:, 1], grid[:, 0] + grid[:, 1]
    assert sorted({round(value, 6) for value in jump}) == pytest.approx([2.9, 3.0, 3.1])
    assert sorted({round(value, 6) for value in reverse}) == pytest.approx([6.9, 7.0, 7.1])
    assert len(grid) == 9
