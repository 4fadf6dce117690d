"""A broken loop, and a broken harness, must not pass."""

import dataclasses
import math

import pytest
from observations import (
    ALLOWED,
    BEGUN,
    LOCKSTEP,
    OVER,
    REALTIME,
    STEP,
    UNTIL,
    fault,
    noticed,
    observation,
    samples,
    statuses,
)

from stiction_studies.faults.judgement.judge import judge
from stiction_studies.faults.observation import BagFound, Ended, Known
from stiction_studies.faults.terms import Bag, Notice, Phase


def outcome(row=None, pace=REALTIME, **changes):
    return judge(row or fault(), pace, observation(**changes), ALLOWED)


def with_op(value: float, at: int):
    """All samples, one of them with another OP."""
    run = list(samples())
    run[at] = dataclasses.replace(run[at], values=(value,))
    return tuple(run)


def without(first: float, last: float, run=None):
    """The samples that do not lie between two wall times."""
    return tuple(s for s in (run or samples()) if not first <= s.wall < last)


def held(first: float, last: float):
    """OP of the plant that nobody changes between two wall times."""
    run, kept = [], None
    for one in samples():
        inside = first <= one.wall < last
        kept = (kept or one.values) if inside else None
        run.append(dataclasses.replace(one, values=kept) if inside else one)
    return tuple(run)


def test_a_loop_that_nothing_happens_to_passes():
    found = outcome()
    assert found.passed
    assert (found.beyond, found.recovered, found.ended, found.bag) == (0.0, 0.0, False, True)
    assert found.without < 0.1


def test_nothing_seen_fails():
    found = outcome(applied=(), sent=(), pv=(), statuses=(), bag=BagFound())
    assert not found.passed
    assert found.recovered is None


def test_an_op_that_nobody_sent_is_no_flow():
    assert not outcome(sent=()).passed


def test_an_op_that_was_sent_only_later_is_no_flow():
    late = tuple(dataclasses.replace(one, wall=one.wall + 1.0) for one in samples())
    assert not outcome(sent=late).passed


@pytest.mark.parametrize("wall", [BEGUN + 1.0, OVER + 1.0])
def test_a_loop_that_stops_for_ever_fails(wall):
    found = outcome(fault(silence=math.inf), applied=without(wall, UNTIL))
    assert found.recovered is None
    assert "does not flow again" in " ".join(found.reasons)


def test_an_op_that_is_held_for_ever_fails():
    sent = without(BEGUN + 1.0, UNTIL, observation().sent)
    assert outcome(fault(silence=math.inf), applied=held(BEGUN + 1.0, UNTIL), sent=sent).reasons


def test_a_pause_is_allowed_where_the_fault_stops_the_loop():
    sent = without(BEGUN, OVER, observation().sent)
    changes = {"applied": held(BEGUN, OVER), "sent": sent}
    assert outcome(fault(silence=math.inf), **changes).passed
    found = outcome(fault(), **changes)
    assert not found.passed
    assert found.without == pytest.approx(OVER - BEGUN, abs=0.2)


def test_a_return_that_is_too_late_fails():
    gap = without(BEGUN, OVER + 3.0)
    assert outcome(fault(silence=math.inf, recovery=5.0), applied=gap).passed
    found = outcome(fault(silence=math.inf, recovery=2.0), applied=gap)
    assert not found.passed
    assert found.recovered == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize("value", [60.0, 40.0, math.nan, math.inf, 1e6])
def test_a_wild_move_fails(value):
    run = with_op(value, 150)
    found = outcome(applied=run, sent=run)
    assert not found.passed
    assert found.beyond > 0.0


def test_a_wild_move_before_the_fault_is_not_of_it():
    run = with_op(60.0, 3)
    assert outcome(applied=run, sent=run).beyond == 0.0


def test_a_new_run_of_the_plant_begins_anew():
    run = list(samples())
    moved = [
        dataclasses.replace(one, stamp=one.stamp - 120 * STEP, values=(90.0,)) for one in run[150:]
    ]
    new = (*run[:150], *moved)
    assert outcome(applied=new, sent=new).passed


def test_a_move_over_a_hole_in_what_was_heard_says_nothing():
    run = samples()
    high = tuple(dataclasses.replace(one, values=(90.0,)) for one in run[160:])
    both = (*run[:150], *high)
    assert outcome(applied=both, sent=both).beyond == 0.0


def test_a_diagnostic_in_time_passes():
    told = statuses((105.5, "error"), (106.5, "error"), (108.5, "warn"))
    found = outcome(fault(notices=noticed()), statuses=told)
    assert found.passed
    assert found.noticed == pytest.approx(1.5)
    assert found.gone == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("told", "reason"),
    [
        ((), "never shown"),
        (((105.5, "warn"),), "never shown"),
        (((107.5, "error"),), "after 3.5 s"),
        (((103.5, "error"), (104.5, "error")), "before the fault"),
        (tuple((105.5 + k, "error") for k in range(9)), "still shown"),
    ],
)
def test_a_diagnostic_that_is_missing_late_or_stays_fails(told, reason):
    found = outcome(fault(notices=noticed()), statuses=statuses(*told))
    assert reason in " ".join(found.reasons)


LATE = "running; 2 samples behind; samples passed over: 3"
OTHER = "running; OP is held; 1 samples behind; samples passed over: 4"


@pytest.mark.parametrize(
    ("texts", "reason"),
    [
        ({103.5: LATE, 104.5: LATE, 105.5: OTHER, 106.5: LATE}, ""),
        ({103.5: LATE, 104.5: LATE, 105.5: OTHER, 109.5: LATE}, ""),
        ({103.5: LATE, 104.5: LATE, 105.5: LATE}, "nothing new"),
        ({103.5: LATE, 107.5: OTHER}, "after 3.5 s"),
        ({103.5: LATE, **{105.5 + k: OTHER for k in range(9)}}, "still shown"),
    ],
    ids=["noticed", "late again after it", "not noticed", "too late", "stays"],
)
def test_a_late_sample_before_a_fault_is_no_sign_of_it(texts: dict[float, str], reason: str):
    told = tuple(
        dataclasses.replace(one, text=texts.get(one.wall, "running"))
        for one in statuses(*((wall, "warn") for wall in texts))
    )
    found = outcome(fault(notices=noticed("warn")), statuses=told)
    if reason:
        assert reason in " ".join(found.reasons)
    else:
        assert found.passed
        assert found.noticed == pytest.approx(1.5)


def test_a_diagnostic_that_ends_too_late_fails():
    told = tuple((104.5 + k, "error") for k in range(11))
    longer = observation(until=130.0, statuses=statuses(*told))
    shown = (*longer.statuses, *statuses()[-1:])
    ending = dataclasses.replace(shown[-1], wall=116.0)
    seen = dataclasses.replace(longer, statuses=(*longer.statuses, ending))
    assert "ended 8.0 s after" in " ".join(
        judge(fault(notices=noticed()), REALTIME, seen, ALLOWED).reasons
    )


def test_a_diagnostic_that_stays_is_asked_to_come_only():
    told = tuple((105.5 + k, "error") for k in range(9))
    stays = fault(notices=(Notice("plant", "error", stays=True),))
    assert outcome(stays, statuses=statuses(*told)).passed
    assert not outcome(stays).passed


def test_a_longer_sample_gives_a_diagnostic_longer():
    told = statuses((107.5, "error"))
    found = outcome(fault(notices=noticed()), statuses=told, period=2.0)
    assert not [reason for reason in found.reasons if "error" in reason]


def test_a_node_that_ends_fails():
    found = outcome(ended={"controller": Ended(0, "done")})
    assert "controller ended with code 0" in found.reasons


def test_a_node_that_the_fault_killed_does_not():
    assert outcome(ended={"recorder": Ended(-9, "", by_fault=True)}).passed


def sentences(**codes: int) -> dict[str, Ended]:
    return {
        node: Ended(code, "the estimator has gone" if code >= 0 else "", by_fault=code < 0)
        for node, code in codes.items()
    }


def test_lockstep_may_end_with_a_sentence():
    ended = sentences(plant=1, controller=0, estimator=-9)
    found = outcome(fault(ends=(LOCKSTEP,)), LOCKSTEP, ended=ended)
    assert found.passed
    assert found.ended


@pytest.mark.parametrize(
    "ended",
    [
        sentences(plant=0, controller=0, estimator=-9),
        sentences(plant=1, controller=1, estimator=-9),
        sentences(plant=1, estimator=-9),
        sentences(controller=0, estimator=-9),
        sentences(plant=1, controller=0, estimator=-9) | {"controller": Ended(0, " \n")},
        sentences(plant=1, controller=0, estimator=-9) | {"plant": Ended(-11, "core dumped")},
    ],
)
def test_lockstep_must_not_end_otherwise(ended):
    assert not outcome(fault(ends=(LOCKSTEP,)), LOCKSTEP, ended=ended).passed


def test_realtime_must_not_end_where_lockstep_may():
    ended = sentences(plant=1, controller=0, estimator=0)
    assert not outcome(fault(ends=(LOCKSTEP,)), REALTIME, ended=ended).passed


@pytest.mark.parametrize(
    "after",
    [
        Known("unaware", {}),
        Known("hold", {"V1.f_s": 5.0, "V1.f_d": 2.0}),
        Known("embedding", {"V1.f_s": 10.2, "V1.f_d": 2.0}),
        Known("embedding", {"V1.f_s": 5.0}),
        Known("embedding", {"V1.f_s": math.nan, "V1.f_d": 2.0}),
    ],
)
def test_a_friction_that_changes_by_a_fault_fails(after):
    assert not outcome(after=after).passed
    assert outcome(fault(forgets=True), after=after).passed


def test_a_controller_that_never_knew_the_friction_fails():
    nothing_known = Known("unaware", {})
    assert not outcome(before=nothing_known, after=nothing_known).passed
    assert outcome(phase=Phase.BEFORE, before=nothing_known, after=nothing_known).passed


@pytest.mark.parametrize(
    "log", ["Traceback (most recent call last):\n  File\n", f"model refused: {'x' * 10_000}\n"]
)
def test_a_log_with_a_traceback_or_text_from_the_network_fails(log):
    assert not outcome(logs={"controller": log}).passed


def test_the_bag_is_judged_as_the_fault_asks():
    holed, unreadable = BagFound(700, 3), BagFound(700, 700, "time is irregular")
    assert not outcome(bag=holed).bag
    assert not outcome(bag=unreadable).bag
    assert not outcome(bag=BagFound()).bag
    assert outcome(fault(bag=Bag.READABLE), bag=holed).passed
    assert not outcome(fault(bag=Bag.READABLE), bag=unreadable).passed
    assert outcome(fault(bag=Bag.LOST), bag=BagFound()).passed


def test_what_the_fault_itself_finds_wrong_fails():
    assert outcome(remarks=("start 3: its first OP is 4 % away",)).reasons


def test_an_outcome_is_plain_values():
    document = outcome().to_dict()
    assert document["passed"] is True
    assert document["fault"] == "made-up"
