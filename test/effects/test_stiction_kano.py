import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction, KanoStiction, from_mapping
from stiction_ros.errors import InputError

percent = st.floats(-150.0, 150.0)
signals = st.lists(percent, min_size=1, max_size=40).map(np.array)
eighths = st.integers(-800, 800).map(lambda n: n / 8.0)  # sums and halves of these are exact
exact_signals = st.lists(st.integers(-240, 240).map(lambda n: n / 8.0), min_size=1, max_size=40)
quarters = st.integers(0, 80).map(lambda n: n / 4.0)
laws = st.builds(KanoStiction, st.floats(0.0, 40.0), st.floats(0.0, 40.0))
undershoots = st.tuples(quarters, quarters).map(lambda p: KanoStiction(max(p), min(p)))


def flow_chart(u: list[float], start: float, s: float, j: float) -> list[float]:
    """The chart of Kano et al., box by box, with y at rest amid its band."""
    u_s, d, stp = start + (s - j) / 2, 1, 1
    u_1, du_1, y = start, 0.0, start
    ys = []
    for u_t in u:
        du = u_t - u_1
        if du * du_1 <= 0 and stp == 0:
            u_s = u_1
            stp = 1
        if stp == 0:
            y = u_t - d * ((s - j) / 2)
        elif -d * (u_t - u_s) > s:
            d = -d
            y = u_t - d * ((s - j) / 2)
            stp = 0
        elif d * (u_t - u_s) > j:
            y = u_t - d * ((s - j) / 2)
            stp = 0
        u_1, du_1 = u_t, du
        ys.append(y)
    return ys


@given(st.builds(KanoStiction, quarters, quarters), exact_signals, eighths)
def test_it_is_the_flow_chart(law: KanoStiction, op: list[float], start: float) -> None:
    expected = flow_chart(op, start, law.stick_band, law.jump)
    assert law.simulate(np.array(op), start).tolist() == expected


def test_it_slips_after_j_onwards_and_after_s_backwards() -> None:
    op = np.array([0.0, 3.0, 5.0, 8.0, 8.0, 9.0, 11.0, 7.0, 5.0, 4.0, 1.0])
    assert KanoStiction(6.0, 2.0).simulate(op).tolist() == [0, 0, 3, 6, 6, 6, 9, 9, 9, 6, 3]


@given(undershoots, exact_signals, eighths)
def test_it_is_he_where_op_rests_after_every_move(
    law: KanoStiction, op: list[float], start: float
) -> None:
    held = np.repeat(op, 2)
    he = HeStiction(law.static_friction, law.dynamic_friction)
    assert np.array_equal(law.simulate(held, start), he.simulate(held, start))


@given(quarters, exact_signals, eighths)
def test_without_a_jump_it_is_a_deadband(band: float, op: list[float], start: float) -> None:
    stem, expected = start, []
    for value in op:
        stem = min(max(stem, value - band / 2.0), value + band / 2.0)
        expected.append(stem)
    assert KanoStiction(band, 0.0).simulate(np.array(op), start).tolist() == expected
    assert HeStiction(band / 2, band / 2).simulate(np.array(op), start).tolist() == expected


@given(signals, percent)
def test_without_friction_the_stem_is_op(op: np.ndarray, start: float) -> None:
    assert np.array_equal(KanoStiction(0.0, 0.0).simulate(op, start), op)


@given(laws, signals, percent)
def test_a_stem_is_never_further_from_op_than_the_static_friction(
    law: KanoStiction, op: np.ndarray, start: float
) -> None:
    assert np.all(np.abs(law.simulate(op, start) - op) <= law.static_friction + 1e-9)


@given(
    undershoots, st.lists(st.floats(0.01, 5.0), min_size=1, max_size=60), st.sampled_from([1, -1])
)
def test_on_a_ramp_it_slips_once_and_then_follows(
    law: KanoStiction, steps: list[float], sign: int
) -> None:
    op = np.cumsum(steps)
    stem = sign * law.simulate(sign * op, 0.0)
    slipped = op > law.static_friction
    assert stem == pytest.approx(np.where(slipped, op - law.dynamic_friction, 0.0), abs=1e-9)
    he = sign * HeStiction(law.static_friction, law.dynamic_friction).simulate(sign * op, 0.0)
    assert np.all(np.diff(stem, prepend=0.0) >= 0.0)
    assert np.all((stem - he >= -1e-9) & (stem - he <= law.jump + 1e-9))


@given(undershoots, exact_signals, eighths)
def test_up_and_down_are_alike(law: KanoStiction, op: list[float], start: float) -> None:
    upright = law.simulate(np.array(op), start)
    assert np.array_equal(-law.simulate(-np.array(op), -start), upright)


@given(st.lists(laws, min_size=1, max_size=6), signals, percent)
def test_a_grid_simulates_as_each_of_its_points(
    points: list[KanoStiction], op: np.ndarray, start: float
) -> None:
    grid = np.array([[p.stick_band, p.jump] for p in points])
    together = KanoStiction.simulate_grid(grid, op, start)
    assert np.array_equal(together, np.column_stack([p.simulate(op, start) for p in points]))


def test_a_grid_takes_one_start_per_point() -> None:
    grid = np.array([[6.0, 2.0], [6.0, 2.0]])
    stems = KanoStiction.simulate_grid(grid, np.array([12.0]), np.array([0.0, 9.0]))
    assert stems.tolist() == [[10.0, 9.0]]


@given(quarters, quarters)
def test_frictions_convert_both_ways(one: float, other: float) -> None:
    static, dynamic = max(one, other), min(one, other)
    law = KanoStiction(static + dynamic, static - dynamic)
    assert (law.static_friction, law.dynamic_friction) == (static, dynamic)
    he = HeStiction(static, dynamic)
    assert (he.stick_band, he.jump) == (law.stick_band, law.jump)


def test_it_is_named_by_s_and_j() -> None:
    built = from_mapping({"effect": "stiction", "law": "kano", "s": 6, "j": 8})
    assert built == KanoStiction(6.0, 8.0)
    assert built.to_mapping() == {"effect": "stiction", "law": "kano", "s": 6.0, "j": 8.0}


@pytest.mark.parametrize(
    ("values", "where"),
    [({"s": -1.0, "j": 0.0}, "s"), ({"s": 1.0, "j": -0.1}, "j"), ({"s": 1.0, "j": "2"}, "j")],
)
def test_values_that_no_valve_has_are_refused(values: dict[str, object], where: str) -> None:
    with pytest.raises(InputError) as caught:
        KanoStiction.from_mapping(values)
    assert caught.value.where == where
