"""Cells of Kano's, XCH and Choudhury's law hold the frictions with one pattern, and no others."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from samples import bases, stems

from stiction_ros.effects import (
    ChoudhuryStiction,
    FloatArray,
    FrictionLaw,
    KanoStiction,
    XchStiction,
)
from stiction_ros.identification.friction import simulate
from stiction_ros.identification.switching import (
    Cells,
    beginning_of,
    cells_at,
    first_slip_range,
    require_cells,
    resting_cells,
)

LAWS = [KanoStiction, XchStiction, ChoudhuryStiction]
every_law = pytest.mark.parametrize("law", LAWS)
seeds = st.integers(0, 10_000)


def smooth_walk(seed: int, samples: int = 300) -> FloatArray:
    """Return a walk that runs on, rests and turns."""
    generator = np.random.default_rng(seed)
    steps = generator.standard_normal(samples) * (generator.random(samples) < 0.8)
    return np.convolve(steps, np.ones(4), mode="same").cumsum() * 0.5


def stem_of(cells: Cells, dynamic: float) -> FloatArray:
    return stems(cells, dynamic)


@every_law
@given(seed=seeds, static=st.floats(0.05, 5.0), share=st.floats(0.0, 1.0), level=st.floats(-3, 3))
def test_pattern_gives_the_stem_of_the_law(
    law: type[FrictionLaw], seed: int, static: float, share: float, level: float
) -> None:
    u, dynamic = smooth_walk(seed), share * static
    assume(abs(abs(u[0] - level) - static) > 1e-9)  # at a tie rounding says whether it moves
    point = np.array([[static - dynamic, static + dynamic]])
    cells = resting_cells(u, np.array([level]), point, law)
    stem = simulate(law, np.array([[static, dynamic]]), u, level)
    assert np.abs(stem_of(cells, dynamic) - stem).max() < 1e-9


@every_law
@given(seed=seeds, static=st.floats(0.2, 4.0), share=st.floats(0.0, 1.0), level=st.floats(-2, 2))
def test_given_its_first_slip_the_stem_is_the_same(
    law: type[FrictionLaw], seed: int, static: float, share: float, level: float
) -> None:
    u, dynamic = smooth_walk(seed), share * static
    point = np.array([[static - dynamic, static + dynamic]])
    begin = beginning_of(u, level, static, law)
    given_first = stem_of(cells_at(u, begin, point, law), dynamic)
    resting = stem_of(resting_cells(u, np.array([level]), point, law), dynamic)
    assert (given_first == resting).all()
    if begin.first < len(u):
        low, high = first_slip_range(u, level, begin, law)
        assert low <= static < high


@every_law
@given(seed=seeds, jump=st.floats(0.1, 4.0), more=st.floats(0.1, 4.0), place=st.floats(0.01, 0.99))
def test_friction_inside_a_cell_has_its_pattern_and_none_outside(
    law: type[FrictionLaw], seed: int, jump: float, more: float, place: float
) -> None:
    u = smooth_walk(seed)
    begin = beginning_of(u, float(u[0]), 0.5, law)
    cell = cells_at(u, begin, np.array([[jump, jump + more]]), law)
    jl, jh, sl, sh = cell.bounds[0]
    assert jl <= jump <= jh
    assert sl <= jump + more <= sh
    high = np.minimum([jh, sh], [jump + 1.0, jump + more + 1.0])
    inner = np.array([jl, sl]) + place * (high - [jl, sl])
    assert (bases(cells_at(u, begin, inner[None, :], law)) == bases(cell)).all()
    below = [[jl - 1e-6, inner[1]], [inner[0], sl - 1e-6]]
    above = [[jh + 1e-6, inner[1]], [inner[0], sh + 1e-6]]
    for outer in (*below, *above):
        if min(outer) > 0.0 and np.isfinite(outer).all():
            assert (bases(cells_at(u, begin, np.array([outer]), law)) != bases(cell)).any()


def test_kano_and_xch_have_the_same_cells() -> None:
    u = smooth_walk(3)
    point = np.array([[0.7, 2.1], [0.2, 1.0]])
    kano, xch = (resting_cells(u, np.zeros(2), point, law) for law in (KanoStiction, XchStiction))
    assert (kano.bounds == xch.bounds).all()
    assert (bases(kano) == bases(xch)).all()


def test_a_level_that_op_leaves_in_one_stroke_slips_at_the_second_sample() -> None:
    u, level = np.array([1.0, 2.0, 3.0, 4.0]), -1.0
    begin = beginning_of(u, level, 0.5, ChoudhuryStiction)
    assert (begin.first, begin.direction) == (1, 1.0)


def test_no_points_have_no_cells() -> None:
    none = np.empty((0, 2))
    cells = cells_at(smooth_walk(0), beginning_of(smooth_walk(0), 0.0, 1.0), none, KanoStiction)
    assert cells.bounds.shape == (0, 4)
    assert bases(cells).shape == (300, 0)


@every_law
def test_the_exact_search_takes_every_law_with_cells(law: type[FrictionLaw]) -> None:
    require_cells(law)
