import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_loops import Kind, Known, changed, known

from stiction_ros.identification.closed_loop.closed_loop import ClosedLoop, close_loop
from stiction_ros.loop.linear_loops import Process, ringing

STICKY = Kind(friction=(3.0, 1.0))


def closed(one: Known) -> ClosedLoop:
    return close_loop(one.record, one.found)


@pytest.mark.parametrize("friction", [(3.0, 1.0), (2.0, 1.0), (6.0, 2.0)])
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("law", ["he", "kano", "choudhury", "semi_physical"])
def test_a_sticky_valve_keeps_the_loop_cycling(
    friction: tuple[float, float], seed: int, law: str
) -> None:
    valve = closed(known(Kind(friction=friction, law=law), seed)).valves[0]
    assert valve.gone > 0.9
    assert 0.8 < valve.moved_with < 1.2
    assert 0.4 < valve.band_share < 1.5


def test_friction_fitted_to_a_square_load_is_behind_a_line() -> None:
    load = 0.4 * np.sign(np.sin(2 * np.pi * np.arange(900) / 60.0))
    moved = known(Kind(noise=0.02), load=load)
    blamed = known(Kind(friction=(0.3, 0.3)), load=load)
    found = close_loop(moved.record, blamed.found)
    assert found.outputs[0].after.gain > 100.0
    assert found.outputs[0].rivalry > 1.0


@settings(max_examples=10)
@given(
    op=st.floats(0.1, 20.0),
    pv=st.floats(0.1, 20.0),
    mirrored=st.booleans(),
    shift=st.floats(-50.0, 50.0),
    time=st.floats(0.01, 100.0),
)
def test_units_change_nothing(
    op: float, pv: float, mirrored: bool, shift: float, time: float
) -> None:
    one = known(STICKY, seed=3)
    other = changed(one, (-op if mirrored else op, shift), (pv, -shift), time)
    before, after = closed(one), closed(other)
    was, now = before.valves[0], after.valves[0]
    assert now.moved_with == pytest.approx(was.moved_with, rel=1e-3)
    assert now.band_share == pytest.approx(was.band_share, rel=1e-6)
    assert now.gone == pytest.approx(was.gone, abs=1e-3)
    first, second = before.outputs[0], after.outputs[0]
    assert first.oscillation is not None
    assert second.oscillation is not None
    assert second.oscillation.period == pytest.approx(first.oscillation.period)
    assert second.oscillation.amplitude == pytest.approx(pv * first.oscillation.amplitude, rel=1e-6)
    assert second.after.gain == pytest.approx(first.after.gain, abs=1e-2)


@pytest.mark.parametrize("size", [2.0, 10.0])
def test_moves_of_the_set_point_hide_no_friction(size: float) -> None:
    moves = np.random.default_rng(5).uniform(-size, size, 9)
    moved = closed(known(Kind(friction=(3.0, 1.0), noise=0.05), sp=20.0 + np.repeat(moves, 100)))
    still = closed(known(Kind(friction=(3.0, 1.0), noise=0.05)))
    assert moved.valves[0].gone == pytest.approx(still.valves[0].gone, abs=0.2)
    assert moved.valves[0].gone > 0.7


def test_a_set_point_that_cycles_goes_on_when_the_record_is_repeated() -> None:
    sp = 20.0 + 6.0 * np.sign(np.sin(2 * np.pi * np.arange(900) / 90.0))
    valve = closed(known(Kind(friction=(1.0, 0.5), noise=0.05), sp=sp)).valves[0]
    assert 0.7 < valve.moved_with < 1.3
    assert valve.gone < 0.3


def test_what_turns_at_each_sample_has_a_period_of_two() -> None:
    found = ringing(
        Process(np.array([[-0.2]]), np.array([[[1.0]]]), np.zeros((1, 1), np.int64), np.zeros(1)),
        0,
        0,
        np.array([0.8, 0.3, 0.0]),
    )
    assert found[0].period == pytest.approx(2.0)
    assert 0.3 < found[0].growth < 1.0


def test_a_loop_whose_controller_is_not_found_says_why() -> None:
    one = known(STICKY)
    rng = np.random.default_rng(2)
    loose = np.cumsum(rng.standard_normal((900, 1)), axis=0)
    record = type(one.record)("loose", 5.0, ("V1",), ("PV1",), loose, one.record.pv, one.record.sp)
    valve = close_loop(record, one.found).valves[0]
    assert "explains" in valve.reason


def test_of_a_healthy_valve_nothing_goes_away() -> None:
    valve = closed(known(Kind(noise=0.05))).valves[0]
    assert valve.gone < 0.05
    assert valve.band_share == 0.0


def test_a_set_point_that_drives_the_loop_is_seen() -> None:
    sp = 20.0 + np.sign(np.sin(2 * np.pi * np.arange(900) / 90.0))
    valve = closed(known(Kind(noise=0.02), sp=sp)).valves[0]
    assert valve.driven > 0.8
    assert closed(known(STICKY)).valves[0].driven == 0.0
