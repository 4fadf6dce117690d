import numpy as np

from stiction_ros.online.input.applied_op import KEPT, SILENT, AppliedOp

STEP = 10
A, B = np.array([40.0]), np.array([60.0])


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
