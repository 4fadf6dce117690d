import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError

percent = st.floats(-150.0, 150.0)
signals = st.lists(percent, min_size=1, max_size=40).map(np.array)


@st.composite
def frictions(draw: st.DrawFn) -> HeStiction:
    static = draw(st.floats(0.0, 40.0))
    return HeStiction(static, static * draw(st.floats(0.0, 1.0)))


def equation_3(u: float, stem: float, f_s: float, f_d: float) -> float:
    e = u - stem
    if abs(e) > f_s:
        return stem + (e - math.copysign(1.0, e) * f_d)
    return stem


def equation_4(u: float, stem: float, f_s: float, f_d: float) -> float:
    if u - stem > f_s:
        return u - f_d
    if u - stem < -f_s:
        return u + f_d
    return stem


@given(frictions(), percent, percent)
def test_step_is_equation_4(friction: HeStiction, stem: float, op: float) -> None:
    expected = equation_4(op, stem, friction.static_friction, friction.dynamic_friction)
    assert friction.step(stem, op) == (expected, expected)


@given(frictions(), percent, percent)
def test_step_is_equation_3(friction: HeStiction, stem: float, op: float) -> None:
    expected = equation_3(op, stem, friction.static_friction, friction.dynamic_friction)
    assert friction.step(stem, op)[1] == pytest.approx(expected, abs=1e-12)


@given(frictions(), signals, percent)
def test_a_stem_stays_or_moves_by_at_least_the_jump(
    friction: HeStiction, op: np.ndarray, start: float
) -> None:
    stem = friction.simulate(op, start)
    moves = np.abs(np.diff(stem, prepend=start))
    assert np.all((moves == 0.0) | (moves >= friction.jump - 1e-9))


@given(frictions(), signals, percent)
def test_a_stem_is_never_further_from_op_than_the_static_friction(
    friction: HeStiction, op: np.ndarray, start: float
) -> None:
    error = np.abs(friction.simulate(op, start) - op)
    assert np.all(error <= friction.static_friction + 1e-9)


@given(signals, percent)
def test_without_friction_the_stem_is_op(op: np.ndarray, start: float) -> None:
    assert np.array_equal(HeStiction(0.0, 0.0).simulate(op, start), op)


@given(st.floats(0.0, 40.0), percent, st.booleans())
def test_equal_frictions_make_the_valve_continuous_at_the_slip(
    band: float, stem: float, opens: bool
) -> None:
    beyond = math.copysign(band + 1e-6, 1.0 if opens else -1.0)
    moved = HeStiction(band, band).step(stem, stem + beyond)[1]
    assert moved == pytest.approx(stem, abs=2e-6)


@given(frictions(), percent, percent)
def test_inverse_reaches_what_lies_at_least_a_jump_away(
    friction: HeStiction, stem: float, wanted: float
) -> None:
    if abs(wanted - stem) < friction.jump:
        wanted = stem + math.copysign(friction.jump + abs(wanted - stem), wanted - stem)
    reached = friction.step(stem, friction.jump_form().inverse(stem, wanted))[1]
    assert reached == pytest.approx(wanted, abs=1e-7)


@given(frictions(), percent, percent)
def test_inverse_comes_as_near_as_the_valve_can(
    friction: HeStiction, stem: float, wanted: float
) -> None:
    reached = friction.step(stem, friction.jump_form().inverse(stem, wanted))[1]
    stay = abs(wanted - stem)
    jump = max(friction.jump - stay, 0.0)
    assert abs(wanted - reached) <= min(stay, jump) + 1e-7


@given(frictions(), percent)
def test_inverse_of_the_present_stem_stays(friction: HeStiction, stem: float) -> None:
    assert friction.step(stem, friction.jump_form().inverse(stem, stem))[1] == stem


@given(st.lists(frictions(), min_size=1, max_size=6), signals, percent)
def test_a_grid_simulates_as_each_of_its_points(
    points: list[HeStiction], op: np.ndarray, start: float
) -> None:
    grid = np.array([[p.static_friction, p.dynamic_friction] for p in points])
    together = HeStiction.simulate_grid(grid, op, start)
    assert np.array_equal(together, np.column_stack([p.simulate(op, start) for p in points]))


def test_a_grid_takes_one_start_per_point() -> None:
    grid = np.array([[5.0, 2.0], [5.0, 2.0]])
    stems = HeStiction.simulate_grid(grid, np.array([12.0]), np.array([0.0, 11.0]))
    assert stems.tolist() == [[10.0, 11.0]]


def test_simulation_without_a_start_rests_at_the_first_value() -> None:
    assert HeStiction(5.0, 2.0).simulate(np.array([50.0, 54.0, 56.0])).tolist() == [50, 50, 54]


@pytest.mark.parametrize(
    ("values", "where"),
    [
        ({"f_s": -1.0, "f_d": 0.0}, "f_s"),
        ({"f_s": 1.0, "f_d": -0.1}, "f_d"),
        ({"f_s": math.nan, "f_d": 0.0}, "f_s"),
        ({"f_s": math.inf, "f_d": 0.0}, "f_s"),
        ({"f_s": 10**400, "f_d": 0.0}, "f_s"),
        ({"f_s": "5", "f_d": 0.0}, "f_s"),
        ({"f_s": True, "f_d": 0.0}, "f_s"),
        ({"f_s": 2.0, "f_d": 5.0}, "f_d"),
    ],
)
def test_values_that_no_valve_has_are_refused(values: dict[str, object], where: str) -> None:
    with pytest.raises(InputError) as caught:
        HeStiction.from_mapping(values)
    assert caught.value.where == where
    assert "\n" not in str(caught.value)


def test_dynamic_above_static_friction_says_how_to_mend_it() -> None:
    with pytest.raises(InputError) as caught:
        HeStiction(2.0, 5.0)
    assert (caught.value.where, bool(caught.value.fix)) == ("f_d", True)
