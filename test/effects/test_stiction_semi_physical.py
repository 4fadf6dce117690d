import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction, SemiPhysicalStiction, from_mapping
from stiction_ros.errors import InputError

percent = st.floats(-150.0, 150.0)
signals = st.lists(percent, min_size=1, max_size=40).map(np.array)
eighths = st.integers(-800, 800).map(lambda n: n / 8.0)  # sums of these are exact


@st.composite
def frictions(draw: st.DrawFn) -> SemiPhysicalStiction:
    static = draw(st.floats(0.0, 40.0))
    dynamic = static * draw(st.floats(0.0, 1.0))
    return SemiPhysicalStiction(static, dynamic, draw(st.floats(1.0, 2.0)))


def as_published(u: list[float], stem: float, f_s: float, f_d: float, k: float) -> list[float]:
    positions = []
    for op in u:
        e = op - stem
        if abs(e) > f_s:
            stem = stem + k * (e - math.copysign(1.0, e) * f_d)
        positions.append(stem)
    return positions


@given(frictions(), signals, percent)
def test_it_is_the_published_recursion(
    law: SemiPhysicalStiction, op: np.ndarray, start: float
) -> None:
    expected = as_published(
        op.tolist(), start, law.static_friction, law.dynamic_friction, law.overshoot
    )
    assert law.simulate(op, start).tolist() == expected


def test_a_slip_overshoots_and_sticks_beyond_op() -> None:
    op = np.array([0.0, 5.0, 6.0, 4.0, 3.0, 2.0, 2.0])
    assert SemiPhysicalStiction(5.0, 2.0, 2.0).simulate(op).tolist() == [0, 0, 8, 8, 8, 0, 0]


@given(st.tuples(st.integers(0, 320), st.integers(0, 320)), st.lists(eighths, min_size=1), eighths)
def test_without_overshoot_it_is_he(pair: tuple[int, int], op: list[float], start: float) -> None:
    static, dynamic = max(pair) / 8.0, min(pair) / 8.0
    he = HeStiction(static, dynamic).simulate(np.array(op), start)
    assert np.array_equal(
        SemiPhysicalStiction(static, dynamic, 1.0).simulate(np.array(op), start), he
    )


@given(frictions(), st.floats(1e-3, 0.1), st.booleans())
def test_a_slow_ramp_moves_it_by_the_jumps_of_he_with_a_smaller_dynamic_friction(
    law: SemiPhysicalStiction, step: float, up: bool
) -> None:
    k, static, dynamic = law.overshoot, law.static_friction, law.dynamic_friction
    assume(static > 0.1)
    assume((k - 1.0) * step <= (2.0 - k) * static + k * dynamic - 1e-6)  # no slip back
    stem = law.simulate(np.arange(200) * (step if up else -step), 0.0)
    moves = np.diff(stem, prepend=0.0) * (1.0 if up else -1.0)
    moves = moves[moves != 0.0]
    same_jump = static - (k * dynamic - (k - 1.0) * static)
    assert np.all(moves >= same_jump - 1e-9)
    assert np.all(moves <= same_jump + k * step + 1e-9)


@given(frictions(), percent, percent)
def test_the_stem_ends_in_the_band_or_nearer_to_op_than_it_was(
    law: SemiPhysicalStiction, stem: float, op: float
) -> None:
    after = abs(op - law.step(stem, op)[1])
    reflected = (law.overshoot - 1.0) * abs(op - stem)
    assert after <= max(law.static_friction, reflected) + 1e-9


@given(signals, percent)
def test_without_friction_and_overshoot_the_stem_is_op(op: np.ndarray, start: float) -> None:
    assert SemiPhysicalStiction(0.0, 0.0, 1.0).simulate(op, start) == pytest.approx(op, abs=1e-9)


@given(st.floats(1.0, 2.0), percent, percent)
def test_without_friction_the_error_swings_out(k: float, stem: float, op: float) -> None:
    after = op - SemiPhysicalStiction(0.0, 0.0, k).step(stem, op)[1]
    assert after == pytest.approx((1.0 - k) * (op - stem), abs=1e-9)


@given(st.floats(0.0, 40.0), percent, st.booleans())
def test_equal_frictions_make_the_slip_continuous(band: float, stem: float, up: bool) -> None:
    moved = SemiPhysicalStiction(band, band).step(stem, stem + (1 if up else -1) * (band + 1e-6))
    assert moved[1] == pytest.approx(stem, abs=3e-6)


@given(st.lists(frictions(), min_size=1, max_size=6), signals, percent, st.booleans())
def test_a_grid_simulates_as_each_of_its_points(
    points: list[SemiPhysicalStiction], op: np.ndarray, start: float, with_k: bool
) -> None:
    grid = np.array([[p.static_friction, p.dynamic_friction, p.overshoot] for p in points])
    grid = grid if with_k else grid[:, :2]
    alone = [SemiPhysicalStiction(*row).simulate(op, start) for row in grid.tolist()]
    together = SemiPhysicalStiction.simulate_grid(grid, op, start)
    assert np.array_equal(together, np.column_stack(alone))


def test_the_published_overshoot_is_the_default() -> None:
    built = from_mapping({"effect": "stiction", "law": "semi_physical", "f_s": 5, "f_d": 2})
    assert built == SemiPhysicalStiction(5.0, 2.0, 1.99)
    assert not isinstance(built, HeStiction)


@pytest.mark.parametrize(
    ("values", "where"),
    [
        ({"f_s": 2.0, "f_d": 5.0}, "f_d"),
        ({"f_s": -1.0, "f_d": 0.0}, "f_s"),
        ({"f_s": 5.0, "f_d": 2.0, "k": 0.9}, "k"),
        ({"f_s": 5.0, "f_d": 2.0, "k": 2.1}, "k"),
    ],
)
def test_values_that_no_valve_has_are_refused(values: dict[str, float], where: str) -> None:
    with pytest.raises(InputError) as caught:
        SemiPhysicalStiction.from_mapping(values)
    assert caught.value.where == where
