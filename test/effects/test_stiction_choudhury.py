import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import ChoudhuryStiction, HeStiction, KanoStiction, from_mapping
from stiction_ros.errors import InputError

percent = st.floats(-150.0, 150.0)
signals = st.lists(percent, min_size=1, max_size=40).map(np.array)
# few values, so that OP often rests
coarse_signals = st.lists(st.integers(-12, 12).map(float), min_size=1, max_size=60).map(np.array)
laws = st.builds(ChoudhuryStiction, st.floats(0.0, 40.0), st.floats(0.0, 40.0))
small_laws = st.tuples(st.integers(0, 32), st.integers(0, 32)).map(
    lambda p: ChoudhuryStiction(p[0] / 4.0, p[1] / 4.0)
)


def sign(x: float) -> int:
    return (x > 0) - (x < 0)


def from_the_text(u: list[float], start: float, s: float, j: float) -> list[float]:
    """The rules of the paper in its words: stuck or not, indicator I, x_ss."""
    x_old, v_old, y = start, 0, start
    x_ss, stuck, indicator, direction = start, True, 0, 0
    at_rest = True  # before the first slip: both ways (S + J)/2
    ys = []
    for x in u:
        v_new = sign(x - x_old)
        if v_new != v_old:  # "the sign of the slope changes"
            if not stuck:
                stuck, x_ss, direction = True, x_old, v_old
                indicator = 1 if v_new == 0 else 0
        elif v_new == 0:  # "or remains zero for two consecutive instants"
            pass
        else:
            if stuck:
                if at_rest:
                    needed = (s + j) / 2
                elif indicator == 1 and v_new == direction:
                    needed = j
                else:
                    needed = s
                if abs(x - x_ss) > needed:
                    stuck = at_rest = False
            if not stuck:
                y = x - v_new * ((s - j) / 2)
        x_old, v_old = x, v_new
        ys.append(y)
    return ys


@given(laws, signals, percent)
def test_it_follows_the_text(law: ChoudhuryStiction, op: np.ndarray, start: float) -> None:
    expected = from_the_text(op.tolist(), start, law.stick_band, law.jump)
    assert law.simulate(op, start).tolist() == expected


@given(small_laws, coarse_signals, st.integers(-12, 12))
def test_it_follows_the_text_where_op_rests(
    law: ChoudhuryStiction, op: np.ndarray, start: int
) -> None:
    expected = from_the_text(op.tolist(), float(start), law.stick_band, law.jump)
    assert law.simulate(op, float(start)).tolist() == expected


def test_it_slips_after_j_onwards_and_after_s_backwards() -> None:
    op = np.array([0.0, 3.0, 5.0, 8.0, 8.0, 9.0, 11.0, 12.0, 7.0, 6.0, 5.0, 2.0])
    assert ChoudhuryStiction(6.0, 2.0).simulate(op).tolist() == [
        *[0, 0, 3, 6],  # from rest at (S + J)/2 = 4, then 2 behind OP
        *[6, 6, 9, 10],  # a rest, then more than J = 2
        *[10, 10, 7, 4],  # turned at 12: more than S = 6 below
    ]


@st.composite
def long_legs(draw: st.DrawFn) -> tuple[ChoudhuryStiction, np.ndarray]:
    """A law with J ≤ S, and OP that goes up and down by more than S in steps below f_S."""
    pair = draw(st.tuples(st.integers(2, 40), st.integers(0, 40)))
    band, jump = max(pair) / 4.0, min(pair) / 4.0
    step = st.integers(1, max(int(4.0 * (band + jump)), 1)).map(lambda n: n / 8.0)
    legs = draw(st.lists(st.lists(step, min_size=3, max_size=15), min_size=1, max_size=5))
    moves: list[float] = []
    for leg, way in zip(legs, itertools.cycle([1.0, -1.0]), strict=False):
        missing = band - sum(leg)
        extra = [leg[0]] * (int(missing / leg[0]) + 1) if missing >= 0 else []
        moves += [way * size for size in leg + extra]
    return ChoudhuryStiction(band, jump), np.cumsum(moves)


@given(long_legs())
def test_it_is_kano_on_long_smooth_strokes(case: tuple[ChoudhuryStiction, np.ndarray]) -> None:
    law, op = case
    kano = KanoStiction(law.stick_band, law.jump).simulate(op, 0.0)
    assert np.array_equal(law.simulate(op, 0.0), kano)


@given(long_legs())
def test_on_long_smooth_strokes_it_differs_from_he_by_a_jump_at_most(
    case: tuple[ChoudhuryStiction, np.ndarray],
) -> None:
    law, op = case
    he = HeStiction(law.static_friction, law.dynamic_friction).simulate(op, 0.0)
    assert np.abs(law.simulate(op, 0.0) - he).max() <= law.jump


@given(long_legs())
def test_without_a_jump_it_is_a_deadband_on_long_smooth_strokes(
    case: tuple[ChoudhuryStiction, np.ndarray],
) -> None:
    band, op = 2.0 * case[0].static_friction, case[1]
    band = min(band, case[0].stick_band)
    steps = np.abs(np.diff(op, prepend=0.0))
    if steps.max() <= band / 2.0:
        he = HeStiction(band / 2.0, band / 2.0).simulate(op, 0.0)
        assert np.array_equal(ChoudhuryStiction(band, 0.0).simulate(op, 0.0), he)


@given(long_legs())
def test_on_long_smooth_strokes_the_stem_stays_in_the_band(
    case: tuple[ChoudhuryStiction, np.ndarray],
) -> None:
    law, op = case
    assert np.abs(law.simulate(op, 0.0) - op).max() <= law.static_friction


@given(laws, st.lists(st.floats(0.01, 5.0), min_size=1, max_size=60))
def test_on_a_ramp_from_rest_it_follows_after_the_static_friction(
    law: ChoudhuryStiction, steps: list[float]
) -> None:
    op = np.concatenate([[0.0], np.cumsum(steps)])
    stem = law.simulate(op)
    slipped = (op > law.static_friction) & (np.arange(len(op)) > 1)  # not where it starts
    assert stem == pytest.approx(np.where(slipped, op - law.dynamic_friction, 0.0), abs=1e-9)


@given(signals, percent)
def test_without_friction_it_misses_only_the_samples_at_which_op_turns(
    op: np.ndarray, start: float
) -> None:
    stem = ChoudhuryStiction(0.0, 0.0).simulate(op, start)
    slope = np.sign(np.diff(op, prepend=start))
    goes_on = slope == np.concatenate([[0.0], slope[:-1]])
    goes_on &= slope != 0.0
    assert np.array_equal(stem[goes_on], op[goes_on])


def test_a_reversal_in_one_sample_moves_it_only_at_the_next() -> None:
    op = np.array([0.0, 10.0, 20.0, 0.0, -1.0])
    assert ChoudhuryStiction(6.0, 2.0).simulate(op).tolist() == [0.0, 0.0, 18.0, 18.0, 1.0]
    assert KanoStiction(6.0, 2.0).simulate(op).tolist() == [0.0, 8.0, 18.0, 2.0, 1.0]


def test_steps_with_a_rest_after_each_never_move_it() -> None:
    op = np.repeat([0.0, 20.0, 40.0, 60.0], 2)
    assert ChoudhuryStiction(6.0, 2.0).simulate(op).tolist() == [0.0] * 8


@given(st.lists(laws, min_size=1, max_size=6), signals | coarse_signals, percent)
def test_a_grid_simulates_as_each_of_its_points(
    points: list[ChoudhuryStiction], op: np.ndarray, start: float
) -> None:
    grid = np.array([[p.stick_band, p.jump] for p in points])
    together = ChoudhuryStiction.simulate_grid(grid, op, start)
    assert np.array_equal(together, np.column_stack([p.simulate(op, start) for p in points]))


def test_it_is_named_by_s_and_j() -> None:
    built = from_mapping({"effect": "stiction", "law": "choudhury", "s": 6, "j": 2})
    assert built == ChoudhuryStiction(6.0, 2.0)
    assert built.to_mapping() == {"effect": "stiction", "law": "choudhury", "s": 6.0, "j": 2.0}


@pytest.mark.parametrize(
    ("values", "where"), [({"s": -1.0, "j": 0.0}, "s"), ({"s": 1.0, "j": -0.1}, "j")]
)
def test_values_that_no_valve_has_are_refused(values: dict[str, float], where: str) -> None:
    with pytest.raises(InputError) as caught:
        ChoudhuryStiction.from_mapping(values)
    assert caught.value.where == where


def test_a_stem_that_moves_goes_on_with_op_before_it_rests() -> None:
    law = ChoudhuryStiction(7.0, 3.0)
    form, memory, stems, op, left = law.jump_form(), law.rest(50.0), [50.0], 50.0, []
    for wanted in (60.0, 60.0, 66.0, 66.0, 66.0):
        op, *left = form.way(op, stems[-1], wanted, left)
        memory, stem = law.step(memory, op)
        stems.append(stem)
    assert stems == [50.0, 50.0, 58.0, 64.0, 64.0, 64.0]
    assert left == []
