"""What may be written never leaves limits or rate."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.opcua.op_limits import SLACK, OpLimits

PERCENT = st.floats(-50.0, 150.0)


@given(PERCENT, st.floats(10.0, 90.0), st.floats(0.0, 100.0), st.floats(0.01, 10.0))
def test_limits_and_rate_hold(wanted: float, in_force: float, elapsed: float, rate: float) -> None:
    limits = OpLimits(np.array([10.0]), np.array([90.0]), np.array([rate]))
    op = limits.allowed(np.array([wanted]), np.array([in_force]), elapsed)
    assert limits.within(op)
    assert abs(op[0] - in_force) <= rate * elapsed + SLACK
    assert abs(op[0] - wanted) <= abs(in_force - wanted) + SLACK
    if 10.0 <= wanted <= 90.0 and abs(wanted - in_force) <= rate * elapsed:
        assert op[0] == wanted


@given(PERCENT, st.floats(10.0, 90.0))
def test_a_transfer_begins_at_the_op_in_force(wanted: float, in_force: float) -> None:
    limits = OpLimits(np.array([10.0]), np.array([90.0]), np.array([5.0]))
    assert limits.allowed(np.array([wanted]), np.array([in_force]), 0.0)[0] == in_force


def test_what_is_no_number_is_not_within() -> None:
    limits = OpLimits(np.array([0.0]), np.array([100.0]), np.array([5.0]))
    assert not limits.within(np.array([np.nan]))
    assert not limits.within(np.array([100.1]))
    assert limits.within(np.array([100.0]))
