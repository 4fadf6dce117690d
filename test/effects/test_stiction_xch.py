import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction, KanoStiction, XchStiction, from_mapping
from stiction_ros.errors import InputError

percent = st.floats(-150.0, 150.0)
signals = st.lists(percent, min_size=1, max_size=40).map(np.array)
eighths = st.integers(-240, 240).map(lambda n: n / 8.0)  # sums of these are exact
exact_signals = st.lists(eighths, min_size=1, max_size=60).map(np.array)
laws = st.tuples(st.floats(0.0, 40.0), st.floats(0.0, 1.0)).map(
    lambda p: XchStiction(p[0], p[0] * p[1])
)
exact_laws = st.tuples(st.integers(0, 80), st.integers(0, 80)).map(
    lambda p: XchStiction(max(p) / 8.0, min(p) / 8.0)
)


def in_words(u: list[float], start: float, f_s: float, f_d: float) -> list[float]:
    """Stuck: He's slip condition. Moving: behind OP by f_D until OP rests or turns."""
    stem, last, moving = start, start, ""
    stems = []
    for op in u:
        if (moving == "up" and op <= last) or (moving == "down" and op >= last):
            moving = ""
        if not moving and op - stem > f_s:
            moving = "up"
        elif not moving and op - stem < -f_s:
            moving = "down"
        if moving == "up":
            stem = op - f_d
        if moving == "down":
            stem = op + f_d
        last = op
        stems.append(stem)
    return stems


@given(laws, signals, percent)
def test_it_is_the_two_state_law(law: XchStiction, op: np.ndarray, start: float) -> None:
    expected = in_words(op.tolist(), start, law.static_friction, law.dynamic_friction)
    assert law.simulate(op, start).tolist() == expected


@given(exact_laws, exact_signals, eighths)
def test_it_is_kano_in_other_parameters(law: XchStiction, op: np.ndarray, start: float) -> None:
    kano = KanoStiction(law.stick_band, law.jump)
    assert np.array_equal(law.simulate(op, start), kano.simulate(op, start))


@given(exact_laws, exact_signals, eighths)
def test_it_is_he_where_op_rests_after_every_move(
    law: XchStiction, op: np.ndarray, start: float
) -> None:
    held, he = np.repeat(op, 2), HeStiction(law.static_friction, law.dynamic_friction)
    assert np.array_equal(law.simulate(held, start), he.simulate(held, start))


@given(st.integers(0, 80), exact_signals, eighths)
def test_equal_frictions_are_a_deadband(band: int, op: np.ndarray, start: float) -> None:
    he = HeStiction(band / 8.0, band / 8.0).simulate(op, start)
    assert np.array_equal(XchStiction(band / 8.0, band / 8.0).simulate(op, start), he)


@given(signals, percent)
def test_without_friction_the_stem_is_op(op: np.ndarray, start: float) -> None:
    assert np.array_equal(XchStiction(0.0, 0.0).simulate(op, start), op)


@given(laws, signals, percent)
def test_a_stem_is_never_further_from_op_than_the_static_friction(
    law: XchStiction, op: np.ndarray, start: float
) -> None:
    assert np.all(np.abs(law.simulate(op, start) - op) <= law.static_friction + 1e-9)


def test_a_ramp_moves_it_without_the_stick_slip_of_he() -> None:
    op = np.concatenate([np.arange(0.0, 10.0), np.arange(10.0, -1.0, -1.0)])
    stem = XchStiction(4.0, 2.0).simulate(op)
    assert stem.tolist() == [*[0] * 5, *range(3, 9), *[8] * 6, *range(5, 1, -1)]
    he = HeStiction(4.0, 2.0).simulate(op)
    assert he.tolist() == [*[0] * 5, *[3] * 3, *[6] * 11, *[3] * 2]


@given(laws, st.lists(st.floats(0.0, 5.0), min_size=1, max_size=60))
def test_rising_op_never_lowers_the_stem(law: XchStiction, steps: list[float]) -> None:
    assert np.all(np.diff(law.simulate(np.cumsum(steps), 0.0), prepend=0.0) >= -1e-9)


@given(st.lists(laws, min_size=1, max_size=6), signals, percent)
def test_a_grid_simulates_as_each_of_its_points(
    points: list[XchStiction], op: np.ndarray, start: float
) -> None:
    grid = np.array([[p.static_friction, p.dynamic_friction] for p in points])
    together = XchStiction.simulate_grid(grid, op, start)
    assert np.array_equal(together, np.column_stack([p.simulate(op, start) for p in points]))


def test_it_is_named_by_f_s_and_f_d() -> None:
    built = from_mapping({"effect": "stiction", "law": "xch", "f_s": 4, "f_d": 2})
    assert built == XchStiction(4.0, 2.0)
    with pytest.raises(InputError) as caught:
        XchStiction(2.0, 4.0)
    assert (caught.value.where, bool(caught.value.fix)) == ("f_d", True)
