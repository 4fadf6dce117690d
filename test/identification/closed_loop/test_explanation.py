import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_loops import Kind, Known, changed, known

from stiction_ros.identification.closed_loop.closed_loop import ClosedLoop, OutputLoop, close_loop
from stiction_ros.identification.closed_loop.explanation import cause as cause_of
from stiction_ros.identification.closed_loop.explanation import explained
from stiction_ros.identification.result import Cause, CauseKind, Identification, VerdictKind
from stiction_ros.signals.outside_line import NO_LINE


def wave(shape: str, period: float, samples: int = 900) -> np.ndarray:
    turn = np.sin(2 * np.pi * np.arange(samples) / period + 0.4)
    return {"sine": turn, "square": np.sign(turn), "triangle": np.arcsin(turn)}[shape]


def told(one: Known) -> Identification:
    return explained(one.record, one.found, close_loop(one.record, one.found))


def cause(one: Known) -> Cause:
    found = told(one).outputs[0].cause
    assert found is not None
    return found


@pytest.mark.parametrize("friction", [(3.0, 1.0), (6.0, 2.0)])
@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_a_sticky_valve_is_the_cause(friction: tuple[float, float], noise: float) -> None:
    found = cause(known(Kind(friction=friction, noise=noise)))
    assert found.kind is CauseKind.VALVE
    assert found.regularity > 1.0
    assert found.period == pytest.approx(5.0 * 70.0, rel=0.15)
    assert "V1" in found.sentence


@pytest.mark.parametrize(("verdict", "made"), [("sticky", True), ("undecided", False)])
def test_a_friction_that_is_found_is_a_cause_however_little_is_beyond_its_price(
    verdict: str, made: bool
) -> None:
    one = known(Kind(friction=(6.0, 2.0), noise=0.05))
    valve = dataclasses.replace(
        one.found.valves[0], verdict=VerdictKind(verdict), evidence={"delta_bic": 1.0}
    )
    found = dataclasses.replace(one.found, valves=(valve,))
    told = explained(one.record, found, close_loop(one.record, found)).outputs[0].cause
    assert told is not None
    assert (told.kind is CauseKind.VALVE) is made


@pytest.mark.parametrize(("fit", "blamed"), [(0.5, True), (0.99, False)])
def test_a_controller_that_is_not_known_acquits_no_sticky_valve(fit: float, blamed: bool) -> None:
    one = known(Kind(friction=(6.0, 2.0), noise=0.05))
    closed = close_loop(one.record, one.found)
    loop = closed.valves[0]
    assert loop.controller is not None
    controller = dataclasses.replace(loop.controller, r_squared=fit)
    idle = dataclasses.replace(loop, controller=controller, gone=0.0)
    told = cause_of(one.record, one.found, dataclasses.replace(closed, valves=(idle,)), 0)
    assert (told.kind is CauseKind.VALVE) == blamed


@pytest.mark.parametrize(
    ("moves", "gone", "blamed"),
    [(1.0, 0.5, True), (1.0, 0.2, False), (20.0, 0.5, False)],
    ids=["much goes away", "little goes away", "the repeated loop is another one"],
)
def test_where_nothing_else_explains_a_cycle_a_friction_does_that_is_not_sure(
    moves: float, gone: float, blamed: bool
) -> None:
    one = known(Kind(friction=(6.0, 2.0), noise=0.05))
    valve = dataclasses.replace(
        one.found.valves[0], verdict=VerdictKind.UNDECIDED, evidence={"delta_bic": -3.0}
    )
    found = dataclasses.replace(one.found, valves=(valve,))
    closed = close_loop(one.record, found)
    loop = dataclasses.replace(closed.valves[0], moved_with=moves, gone=gone)
    output = dataclasses.replace(closed.outputs[0], after=NO_LINE, alone=NO_LINE)
    told = cause_of(one.record, found, ClosedLoop((loop,), (output,)), 0)
    assert told.kind is (CauseKind.VALVE if blamed else CauseKind.UNKNOWN)
    assert ("Nothing else explains it" in told.sentence) == blamed


@pytest.mark.parametrize(
    ("regularity", "share", "blamed"), [(0.3, 0.2, True), (0.0, 0.7, True), (0.0, 0.2, False)]
)
def test_a_valve_that_sticks_makes_no_cycle_where_nothing_comes_back(
    regularity: float, share: float, blamed: bool
) -> None:
    one = known(Kind(friction=(6.0, 2.0), noise=0.05))
    closed = close_loop(one.record, one.found)
    swing = closed.outputs[0].oscillation
    assert swing is not None
    swing = dataclasses.replace(swing, regularity=regularity, share=share)
    output = dataclasses.replace(closed.outputs[0], oscillation=swing)
    told = cause_of(one.record, one.found, ClosedLoop(closed.valves, (output,)), 0)
    assert told.kind is (CauseKind.VALVE if blamed else CauseKind.NONE)


def test_where_there_is_no_line_there_is_no_rival() -> None:
    worse = dataclasses.replace(NO_LINE, gain=-4.0)
    assert OutputLoop("PV1", None, after=worse, alone=worse).rivalry <= 0.0
    line = dataclasses.replace(NO_LINE, gain=9.0)
    assert OutputLoop("PV1", None, after=line, alone=line).rivalry == np.inf


@pytest.mark.parametrize("shape", ["sine", "square", "triangle"])
@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.5, 0.4)])
def test_a_load_that_swings_is_the_cause(shape: str, friction: tuple[float, float]) -> None:
    moved = known(Kind(noise=0.05), load=0.4 * wave(shape, 57.0))
    blamed = known(Kind(friction=friction)).found
    found = cause(Known(moved.record, dataclasses.replace(blamed, stem=moved.record.op)))
    assert found.kind is CauseKind.DISTURBANCE
    assert found.period == pytest.approx(5.0 * 57.0, rel=0.03)


@pytest.mark.parametrize("kept", [True, False])
def test_a_set_point_that_swings_is_the_cause(kept: bool) -> None:
    one = known(Kind(noise=0.05), sp=20.0 + wave("square", 80.0))
    record = one.record if kept else dataclasses.replace(one.record, sp=None)
    found = cause(Known(record, one.found))
    assert found.kind is CauseKind.SET_POINT
    assert found.period == pytest.approx(5.0 * 80.0, rel=0.03)


def test_a_set_point_that_moves_now_and_then_is_no_cause() -> None:
    moves = np.random.default_rng(5).uniform(-6.0, 6.0, 9)
    one = known(Kind(friction=(3.0, 1.0), noise=0.05), sp=20.0 + np.repeat(moves, 100))
    closed = close_loop(one.record, one.found)
    output = dataclasses.replace(closed.outputs[0], set_point_line=2.0)
    loop = dataclasses.replace(closed.valves[0], driven=0.95)
    told = cause_of(one.record, one.found, ClosedLoop((loop,), (output,)), 0)
    assert told.kind is CauseKind.VALVE


@pytest.mark.parametrize("friction", [(0.0, 0.0), (3.0, 1.0)])
def test_a_clock_that_pv_follows_is_the_cause_whatever_else_is_there(
    friction: tuple[float, float],
) -> None:
    one = known(Kind(friction=friction, noise=0.05), sp=20.0 + wave("square", 80.0))
    closed = close_loop(one.record, one.found)
    loop = dataclasses.replace(closed.valves[0], driven=0.2)
    clock = dataclasses.replace(NO_LINE, gain=90.0, period=80.0)
    swing = closed.outputs[0].oscillation
    assert swing is not None
    output = dataclasses.replace(
        closed.outputs[0],
        after=clock,
        alone=clock,
        oscillation=dataclasses.replace(swing, regularity=0.5),
        set_point_line=0.9,
    )
    told = cause_of(one.record, one.found, ClosedLoop((loop,), (output,)), 0)
    assert told.kind is CauseKind.SET_POINT
    still = dataclasses.replace(output, set_point=None)
    told = cause_of(one.record, one.found, ClosedLoop((loop,), (still,)), 0)
    assert told.kind is not CauseKind.SET_POINT


def test_a_controller_that_rings_is_the_cause() -> None:
    found = cause(known(Kind(noise=0.1, gain=2.8, integral_time=12.0), samples=2000))
    assert found.kind is CauseKind.TUNING
    assert found.regularity > 1.0


@pytest.mark.parametrize("seed", range(4))
def test_noise_is_no_oscillation(seed: int) -> None:
    found = cause(known(Kind(noise=0.1, gain=0.5), seed, samples=1500))
    assert found.kind is CauseKind.NONE


@settings(max_examples=6)
@given(
    op=st.floats(0.05, 20.0),
    pv=st.floats(0.05, 20.0),
    mirrored=st.booleans(),
    shift=st.floats(-50.0, 50.0),
    time=st.floats(0.01, 100.0),
)
def test_units_change_only_units(
    op: float, pv: float, mirrored: bool, shift: float, time: float
) -> None:
    one = known(Kind(friction=(3.0, 1.0), noise=0.1), seed=2)
    before, after = cause(one), cause(changed(one, (-op if mirrored else op, shift), (pv, 3), time))
    assert after.kind is before.kind
    assert before.period is not None
    assert after.period == pytest.approx(before.period * time)
    assert after.amplitude == pytest.approx(before.amplitude * pv, rel=1e-6)
    assert after.regularity == pytest.approx(before.regularity, rel=1e-3)


def test_the_keys_of_the_contract() -> None:
    document = told(known(Kind(friction=(3.0, 1.0)))).to_dict()
    found = document["outputs"][0]["cause"]
    assert list(found) == ["kind", "period", "regularity", "amplitude"]
    assert found["kind"] == "valve"
    assert 0.5 < document["valves"][0]["band_share"] < 1.5
    assert document["valves"][0]["evidence"]["loop_gone"] > 0.9
    assert document["valves"][0]["evidence"]["outside_line"] < 0.0
