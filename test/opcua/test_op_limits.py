"""What may be written never leaves limits or rate."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.opcua.op_limits import SLACK, OpLimits, RateWatch

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


def test_limits_that_no_op_meets_are_named() -> None:
    limits = OpLimits(np.array([80.0, 0.0]), np.array([20.0, 100.0]), np.array([5.0, 5.0]))
    assert limits.crossed(("V1", "V2")) == "limits of V1 are 80 to 20"
    assert OpLimits(limits.high, limits.low, limits.rate).crossed(("V1", "V2")) == (
        "limits of V2 are 100 to 0"
    )


def test_what_is_no_number_is_not_within() -> None:
    limits = OpLimits(np.array([0.0]), np.array([100.0]), np.array([5.0]))
    assert not limits.within(np.array([np.nan]))
    assert not limits.within(np.array([100.1]))
    assert limits.within(np.array([100.0]))


def test_what_the_rate_cuts_is_counted_and_what_the_limits_cut_is_not() -> None:
    limits = OpLimits(np.array([10.0, 0.0]), np.array([90.0, 100.0]), np.array([2.0, 30.0]))
    watch = RateWatch(("V1", "V2"), (2.0, 30.0), 1.0)
    assert watch.text() == ""
    for wanted in ([95.0, 50.0], [89.0, 55.0]):  # V1 within its rate, but for its limit
        op = limits.allowed(np.array(wanted), np.array([89.5, 50.0]), 1.0)
        assert not watch.note(limits, np.array(wanted), np.array([89.5, 50.0]), op)
    assert watch.text() == ""
    for step in (9.2, 4.0):
        in_force, wanted = np.array([50.0, 50.0]), np.array([50.0 - step, 60.0])
        assert watch.note(limits, wanted, in_force, limits.allowed(wanted, in_force, 1.0))
    assert watch.text() == (
        "OP of V1 is cut by the map's rate of 2 %/s at 2 of the last 4 samples; "
        "the controller wanted steps up to 9.2 %"
    )
    assert dict(watch.keys()) == {
        "rate_watched": 4,
        "rate_cut:V1": 2,
        "wanted_step:V1": "9.2",
        "rate_cut:V2": 0,
        "wanted_step:V2": "0",
    }


def test_only_the_last_sixty_samples_count() -> None:
    limits = OpLimits(np.array([0.0]), np.array([100.0]), np.array([2.0]))
    watch, in_force = RateWatch(("V1",), (2.0,), 1.0), np.array([50.0])
    for wanted in (*[60.0] * 10, *[51.0] * 55):
        want = np.array([wanted])
        watch.note(limits, want, in_force, limits.allowed(want, in_force, 1.0))
    assert "at 5 of the last 60 samples" in watch.text()
    watch.begin(limits, in_force, in_force)
    assert watch.text() == ""


def test_the_way_from_a_transfer_is_left_out_but_no_longer_than_it_takes() -> None:
    limits = OpLimits(np.array([0.0]), np.array([100.0]), np.array([2.0]))
    watch, op, want = RateWatch(("V1",), (2.0,), 1.0), np.array([50.0]), np.array([57.0])
    watch.begin(limits, want, op)
    for _ in range(3):  # 52, 54 and 56 are cut, 57 is not
        now = limits.allowed(want, op, 1.0)
        assert watch.note(limits, want, op, now)
        op = now
    assert not watch.note(limits, want, op, limits.allowed(want, op, 1.0))
    assert watch.text() == ""
    watch.begin(limits, np.array([57.0]), np.array([50.0]))
    for k in range(8):  # one that goes on with jumps
        want = np.array([40.0 + 20.0 * (k % 2)])
        watch.note(limits, want, np.array([50.0]), limits.allowed(want, np.array([50.0]), 1.0))
    assert "at 4 of the last 4 samples" in watch.text()
