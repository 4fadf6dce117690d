from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_loops import Kind, known

from stiction_ros.records.record import Record
from stiction_ros.signals.controller_recovery import ControllerStatus, RecoveredController, recover

STICKY = Kind(friction=(3.0, 1.0), noise=0.05)


def recovered(record: Record, **changes: Any) -> RecoveredController:
    signals: dict[str, Any] = {
        "op": record.op[:, 0],
        "pv": record.pv[:, 0],
        "sp": None if record.sp is None else record.sp[:, 0],
        "stretches": [(0, len(record))],
    }
    return recover(**(signals | changes), longest_span=12)


@pytest.mark.parametrize("lag", [0, 1, 2])
@pytest.mark.parametrize("gain", [1.0, 0.4])
def test_a_pi_controller_is_recovered_exactly(lag: int, gain: float) -> None:
    kind = Kind(friction=(3.0, 1.0), gain=gain, integral_time=11.0, lag=lag, noise=0.05)
    found = recovered(known(kind).record)
    assert found.status is ControllerStatus.OK
    assert found.gain == pytest.approx(gain, rel=1e-6)
    assert found.integral_time == pytest.approx(11.0, rel=1e-6)
    assert found.lag == lag
    assert found.span == 1
    assert found.r_squared == pytest.approx(1.0, abs=1e-9)


@given(seed=st.integers(0, 20))
@settings(max_examples=8)
def test_rounded_signals_leave_the_controller(seed: int) -> None:
    record = known(STICKY, seed).record
    found = recovered(
        record, op=np.round(record.op[:, 0] / 0.5) * 0.5, pv=np.round(record.pv[:, 0] / 0.1) * 0.1
    )
    assert found.status is ControllerStatus.OK
    assert found.gain == pytest.approx(1.0, rel=0.25)
    assert found.gain / found.integral_time == pytest.approx(1.0 / 8.0, rel=0.15)


def test_signals_held_between_reports_leave_the_controller() -> None:
    record = known(STICKY).record
    held = np.arange(len(record)) // 4 * 4
    found = recovered(record, op=record.op[held, 0], pv=record.pv[held, 0])
    assert found.status is ControllerStatus.OK
    assert found.gain / found.integral_time == pytest.approx(1.0 / 8.0, rel=0.2)


def test_a_set_point_that_is_not_recorded_is_found() -> None:
    found = recovered(known(STICKY).record, sp=None)
    assert found.gain == pytest.approx(1.0, rel=1e-6)
    assert found.integral_time == pytest.approx(8.0, rel=1e-6)
    assert found.set_point == pytest.approx(np.full(900, 20.0), abs=1e-3)


@given(
    op=st.floats(0.01, 100.0).map(lambda size: size if size > 1.0 else -size),
    pv=st.floats(0.01, 100.0).map(lambda size: size if size > 1.0 else -size),
    shift=st.floats(-100.0, 100.0),
)
@settings(max_examples=15)
def test_units_change_nothing_but_the_gain(op: float, pv: float, shift: float) -> None:
    record = known(STICKY).record
    assert record.sp is not None
    rough = np.round(record.op[:, 0] / 0.25) * 0.25
    before = recovered(record, op=rough)
    after = recovered(
        record,
        op=rough * op + shift,
        pv=record.pv[:, 0] * pv - shift,
        sp=record.sp[:, 0] * pv - shift,
    )
    assert after.gain == pytest.approx(before.gain * op / pv, rel=1e-5)
    assert after.integral_time == pytest.approx(before.integral_time, rel=1e-5)
    assert after.r_squared == pytest.approx(before.r_squared, rel=1e-6)
    assert (after.span, after.lag) == (before.span, before.lag)


def test_standard_errors_hold_the_truth() -> None:
    inside = 0
    for seed in range(12):
        record = known(STICKY, seed).record
        rough = np.round(record.pv[:, 0] / 0.2) * 0.2
        found = recovered(record, pv=rough)
        reset = found.coefficients[1]
        inside += abs(reset - 1.0 / 8.0) < 3.0 * np.sqrt(found.covariance[1, 1]) + 0.03 * abs(reset)
    assert inside >= 10


def test_stretches_in_manual_are_left_out() -> None:
    record = known(STICKY).record
    op = record.op[:, 0].copy()
    op[300:400] = 10.0
    found = recovered(record, op=op, stretches=[(0, 300), (400, 900)])
    assert found.gain == pytest.approx(1.0, rel=1e-6)


def test_a_limit_of_op_is_seen_and_left_out() -> None:
    sp = 20.0 + np.sign(np.sin(2 * np.pi * np.arange(900) / 150.0))
    record = known(Kind(noise=0.05, limits=(-np.inf, 50.8)), sp=sp).record
    found = recovered(record)
    assert found.limits == (-np.inf, pytest.approx(50.8))
    assert found.gain == pytest.approx(1.0, rel=1e-6)


def test_op_that_does_not_answer_pv_has_no_controller() -> None:
    rng = np.random.default_rng(4)
    noise = np.cumsum(rng.standard_normal(900))
    record = known(STICKY).record
    found = recovered(record, op=noise, pv=20.0 + rng.standard_normal(900))
    assert found.status is ControllerStatus.NO_RELATION
    assert "explains" in found.reason
    constant = recovered(record, op=np.full(900, 3.0))
    assert constant.status is ControllerStatus.NO_MOVES
