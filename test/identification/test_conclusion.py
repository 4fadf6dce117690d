"""Verdicts and intervals of the default search, as tables."""

import pytest
import simulated_loops as loops
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction
from stiction_ros.identification import IdentificationOptions, VerdictKind, identify
from stiction_ros.identification.conclusion import DEADBAND, SMALL_JUMP, judge

CLEAR = {"delta_bic": 60.0, "half_1": 30.0, "half_2": 30.0, "moves": 40.0, "deadband_loss": 50.0}
STICKY, BACKLASH, HEALTHY, UNDECIDED = VerdictKind


@pytest.mark.parametrize(
    ("changes", "static", "verdict"),
    [
        ({}, (2.0, 2.4), STICKY),
        ({"deadband_loss": 0.0}, (2.0, 2.4), BACKLASH),
        ({"deadband_loss": DEADBAND - 0.1}, (2.0, 2.4), BACKLASH),
        ({"deadband_loss": DEADBAND + 0.1}, (2.0, 2.4), STICKY),
        ({"deadband_loss": 0.0}, (2.0, 5.5), STICKY),  # a jump of 3.6 % explains it as well
        ({"delta_bic": 19.0}, (2.0, 2.4), UNDECIDED),
        ({"delta_bic": 19.0, "deadband_loss": 0.0}, (2.0, 2.4), UNDECIDED),
        ({"half_1": -1.0}, (2.0, 2.4), UNDECIDED),
        ({"half_2": 0.0}, (2.0, 2.4), UNDECIDED),
        ({"moves": 5.0}, (2.0, 2.4), UNDECIDED),
        ({"moves": 5.0, "deadband_loss": 0.0}, (2.0, 2.4), UNDECIDED),
        ({}, (0.3, 2.4), UNDECIDED),  # may be less than three hundredths of OP's range
        ({"delta_bic": -5.0}, (0.0, 0.2), HEALTHY),
        ({"delta_bic": -5.0}, (0.0, 0.3), HEALTHY),
        ({"delta_bic": -5.0}, (0.0, 0.7), UNDECIDED),
        ({"delta_bic": -5.0, "moves": 5.0}, (0.0, 0.2), UNDECIDED),
    ],
)
def test_the_verdict_follows_from_evidence_and_interval(
    changes: dict[str, float], static: tuple[float, float], verdict: VerdictKind
) -> None:
    assert judge(CLEAR | changes, static, (1.9, 2.0), 20.0) is verdict


@given(
    st.floats(-100.0, 1000.0),
    st.floats(0.0, 100.0),
    st.floats(0.0, 5.0),
    st.floats(0.0, 5.0),
    st.floats(0.5, 100.0),
)
def test_units_of_op_change_no_verdict_beyond_the_absolute_limit(
    gain: float, deadband: float, low: float, more: float, scale: float
) -> None:
    figures = CLEAR | {"delta_bic": gain, "deadband_loss": deadband}
    static, dynamic = (low, low + more), (0.5 * low, low)
    said = judge(figures, static, dynamic, 20.0)
    wider = [(scale * begin, scale * end) for begin, end in (static, dynamic)]
    scaled = judge(figures, *wider, scale * 20.0)
    near = min(abs(low - 0.6), abs(low + more - 0.6)) < 1e-9
    near = near or abs(low + more - 0.5 * low - SMALL_JUMP * (1.5 * low + more)) < 1e-9
    assert near or said is scaled


@pytest.mark.parametrize("kind", list(VerdictKind))
def test_two_verdicts_are_friction(kind: VerdictKind) -> None:
    assert kind.has_friction is (kind.value in ("sticky", "backlash"))


@pytest.mark.parametrize(
    ("friction", "verdict"), [((5.0, 2.0), STICKY), ((3.0, 3.0), BACKLASH), ((0.0, 0.0), HEALTHY)]
)
def test_the_whole_search_tells_the_jump_from_the_deadband(
    friction: tuple[float, float], verdict: VerdictKind
) -> None:
    record = loops.example1(3, samples=1200, friction=friction)
    options = IdentificationOptions("exact", output_order=3, input_order=3, delay=(5, 5))
    (valve,) = identify(record, options).valves
    assert valve.verdict is verdict
    assert (valve.jump == 0.0) is (verdict is not STICKY)
    low, high = valve.static_interval
    assert low <= friction[0] <= high + 0.05
    assert valve.dynamic_interval[0] <= friction[1] <= valve.dynamic_interval[1] + 0.05
    HeStiction(valve.static_friction, valve.dynamic_friction)  # a law: f_D does not exceed f_S
