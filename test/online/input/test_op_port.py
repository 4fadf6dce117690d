"""Which OP is taken, as a table."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.input.op_port import KEPT, SILENT, AppliedOp, OpPort, Reception

SECOND = 10**9
ME, OTHER = "/controller", "/stranger"
OP = np.array([50.0])
STEP = 10
A, B = np.array([40.0]), np.array([60.0])


def port(commander: str = ME, *, exact: bool = False) -> OpPort:
    return OpPort(commander, SECOND, exact=exact)


@pytest.mark.parametrize(
    ("sender", "seconds", "op", "realtime", "lockstep"),
    [
        (ME, 10.0, OP, "taken", "taken"),
        (ME, 9.8, OP, "taken", "past"),
        (ME, 9.0, OP, "late", "past"),
        (ME, 7.0, OP, "late", "past"),
        (ME, 6.9, OP, "past", "past"),
        (ME, 0.0, OP, "past", "past"),
        (ME, 10.3, OP, "taken", "future"),
        (ME, 11.0, OP, "future", "future"),
        (ME, 1e6, OP, "future", "future"),
        (OTHER, 10.0, OP, "name", "name"),
        ("", 10.0, OP, "name", "name"),
        ("controller", 10.0, OP, "name", "name"),
        ("/unit1/controller", 10.0, OP, "name", "name"),
        (ME, 10.0, None, "tags", "tags"),
        (ME, 10.0, np.array([np.nan]), "number", "number"),
        (ME, 10.0, np.array([1.0, np.inf]), "number", "number"),
    ],
)
def test_what_becomes_of_an_op_for_ten_seconds(sender, seconds, op, realtime, lockstep):
    for exact, expected in ((False, realtime), (True, lockstep)):
        judge = port(exact=exact)
        found = judge.judge(sender, round(seconds * 1e9), op, 10 * SECOND)
        assert found.value == expected
        assert judge.counts == {found: 1}
        assert (judge.complaint(found, sender) == "") is (expected in ("taken", "repeated"))


def test_the_first_op_of_a_sample_wins():
    judge = port()
    found = [judge.judge(ME, 10 * SECOND, OP, 10 * SECOND) for _ in range(3)]
    assert [f.value for f in found] == ["taken", "repeated", "repeated"]
    assert judge.judge(ME, 9 * SECOND, OP, 10 * SECOND) is Reception.REPEATED


def test_without_a_commander_the_first_named_one_commands():
    judge = port("")
    assert judge.judge("", 0, OP, 0) is Reception.NAME
    assert judge.judge(OTHER, 0, np.array([np.nan]), 0) is Reception.NUMBER
    assert judge.judge(ME, 0, OP, 0) is Reception.TAKEN
    assert judge.judge(OTHER, SECOND, OP, SECOND) is Reception.NAME
    assert OTHER in judge.complaint(Reception.NAME, OTHER)
    assert ME in judge.complaint(Reception.NAME, OTHER)


@given(
    st.lists(
        st.tuples(st.sampled_from([ME, OTHER, ""]), st.integers(-(10**12), 10**12)), max_size=20
    )
)
def test_no_junk_stops_the_op_of_the_sample_to_come(junk):
    judge = port()
    for sender, stamp in junk:
        judge.judge(sender, stamp, OP, 10 * SECOND)
    assert judge.judge(ME, 12 * SECOND, OP, 12 * SECOND) is Reception.TAKEN


def test_what_was_given_belongs_to_the_sample_before() -> None:
    told = AppliedOp(STEP)
    told.add(100, A)
    told.add(110, B)
    assert told.before(110, True).op is A
    assert told.before(120, True).op is B


def test_where_nobody_tells_the_own_op_counts_if_it_was_in_time() -> None:
    told = AppliedOp(STEP)
    for in_time in (True, False):
        given = told.before(100, in_time)
        assert (given.op, given.known) == (None, in_time)


def test_where_someone_tells_a_message_that_lacks_leaves_it_unknown_for_a_while() -> None:
    told = AppliedOp(STEP)
    told.add(100, A)
    told.before(110, True)
    known = [told.before(110 + STEP * k, True).known for k in range(1, SILENT + 3)]
    assert known == [False] * (SILENT - 1) + [True] * 3


def test_the_op_in_force_is_the_newest_before_the_sample() -> None:
    told = AppliedOp(STEP)
    assert told.in_force(100) is None
    told.add(80, A)
    told.add(90, B)
    told.add(100, A)
    assert told.in_force(100) is B
    assert told.in_force(100 + 100 * STEP) is None


def test_what_belongs_to_no_sample_does_not_pile_up() -> None:
    told = AppliedOp(STEP)
    for k in range(3 * KEPT):
        told.add(10**9 + k, A)
    told.add(90, B)
    assert len(told._told) == KEPT
    assert told.before(100, True).op is B
