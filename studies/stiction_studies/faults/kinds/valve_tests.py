"""What comes between a valve test: the former mode is in force again, without a bump."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.kinds.lost_signals import NAN, relayed
from stiction_studies.faults.kinds.stopped_nodes import NO_PV, kill_and_restart
from stiction_studies.faults.loop.rules import instead, late_by
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.loop.setting_up import scenario
from stiction_studies.faults.terms import Notice, Pace, Phase

REALTIME, LOCKSTEP = (Pace.REALTIME,), (Pace.LOCKSTEP,)
TEST = "valve_test"  # mode of the controller
BEGINS, ENDS = 10.0, 10.0  # s until a test has begun, and has ended after the fault
TURN = 60.0  # s until the set-point rests
CALM, AHEAD = 80, 330  # s for which the set-point rests before a test begins, and from there
SOONEST, LATEST = 5, 200  # samples of the test before the fault: OP rests at first, then moves
REACH = {"valve_test_op": 10.0, "valve_test_pv": 8.0}  # how far a test may go
NOISE, ROUNDING = 0.1, 1e-9  # of PV: several standard deviations; of OP, %
AWAY = 2.0  # of the set-point, and of OP in %: well beyond rounding


def in_a_test(
    put: Callable[[RunningLoop], None], goes_on: bool = False
) -> Callable[[RunningLoop], None]:
    """Return what does something to a loop of which the valve is tested.

    Args:
        put: does it, some samples after the test has begun, which the seed decides.
        goes_on: whether the test goes on, and is then ended by its parameter.
    """

    def whole(loop: RunningLoop) -> None:
        loop.wait_until(lambda: _rests(loop), TURN)
        _set(loop, TEST)
        if not loop.wait_until(lambda: loop.known.mode == TEST, BEGINS):
            loop.remark("no valve test began")
            return
        begun = loop.known.since
        latest = SOONEST + 1 if goes_on and loop.pace is Pace.REALTIME else LATEST
        loop.wait_samples(int(np.random.default_rng(loop.seed).integers(SOONEST, latest)))
        if loop.known.mode != TEST:
            loop.remark("the valve test ended before the fault")
        loop.begins()  # in lockstep all wait while a test is judged for the first time
        put(loop)
        if loop.pace is Pace.LOCKSTEP and any(
            node.code is not None for node in loop.nodes.values()
        ):
            _look(loop, begun, math.inf)
            return  # all end
        if goes_on:
            if loop.known.mode != TEST:
                loop.remark("the valve test ended")
            _set(loop, "auto")
        if not loop.wait_until(lambda: loop.known.mode != TEST, ENDS):
            loop.remark("the valve test went on")
            return
        ended = loop.known.since
        loop.wait_samples(2)
        if ended > begun:  # the run is the same
            _look(loop, begun, ended)

    return whole


def _rests(loop: RunningLoop) -> bool:
    """Return whether the set-point rests, and for as long as a test may take."""
    at, now = scenario().set_points.at, loop.last("pv").stamp / 1e9
    return bool((at(now - CALM) == at(now + AHEAD)).all())


def _look(loop: RunningLoop, begun: int, ended: float) -> None:
    """Remark what went beyond the limits of a test from ``begun`` to ``ended``, and its end, ns."""
    op, applied, pv = (
        {one.stamp: np.array(one.values) for one in list(loop.heard(topic))}
        for topic in ("op", "op_applied", "pv")
    )
    start = op[max(stamp for stamp in op if stamp < begun)]
    sp = scenario().set_points.at(begun / 1e9)
    for values, middle, reach in (
        (op, start, REACH["valve_test_op"]),
        (pv, sp, REACH["valve_test_pv"] + NOISE),
    ):
        away = [np.abs(v - middle).max() for k, v in values.items() if begun <= k < ended]
        if (far := float(np.nanmax(away))) > reach:
            loop.remark(f"the valve test went {far:.2f} away, allowed are {reach:g}")
    back = min((stamp for stamp in op if stamp >= ended), default=None)
    if back is None:
        return
    in_force = applied[max(stamp for stamp in applied if stamp < back)]
    move = min(float(np.abs(op[back] - one).max()) for one in (start, in_force))
    from stiction_ros.online.controller.live import FIRST_MOVE  # loads what computes

    if move > FIRST_MOVE + ROUNDING:
        loop.remark(f"OP moves {move:.2f} % where the former mode goes on")


def _set(loop: RunningLoop, mode: str) -> None:
    if loop.probe.set_parameters("controller", {"mode": mode}) != [True]:
        loop.remark(f"the controller did not take mode {mode}")


def by_another(message: Any) -> list[Any]:
    """Let an OP in force be that of someone else."""
    message.header.frame_id = "/operator"
    message.position = moved(list(message.position))
    return [message]


def taken_over(loop: RunningLoop) -> None:
    """Let OP in force be that of someone else until the test ends, as an operator keeps it."""
    loop.probe.rule("op_applied", by_another)
    loop.wait_until(lambda: loop.known.mode != TEST, ENDS)
    loop.probe.rule("op_applied")


def moved(row: list[float]) -> list[float]:
    """Return the values beside where they were."""
    return [value + AWAY for value in row]


LIMITED = {"controller": REACH}
FAULTS = (
    Fault(
        "test-pv-bad",
        "PVs that are NaN end a valve test: OP goes back, the former mode goes on from there",
        in_a_test(relayed("pv", lambda: instead(lambda row: [NAN] * len(row), 8), seconds=1.0)),
        parameters=LIMITED,
        relayed=("pv",),
        notices=(Notice("controller", "warn"),),
    ),
    Fault(
        "test-pv-late",
        "PVs that come two samples late end a valve test",
        in_a_test(relayed("pv", lambda: late_by(2), seconds=2.0)),
        REALTIME,
        parameters=LIMITED,
        relayed=("pv",),
        silence=math.inf,
    ),
    Fault(
        "test-set-point-moved",
        "a move of the set-point ends a valve test",
        in_a_test(relayed("sp", lambda: instead(moved, 20), seconds=1.0)),
        parameters=LIMITED,
        relayed=("sp",),
    ),
    Fault(
        "test-taken-over",
        "an OP in force that is not the controller's ends a valve test, and the control goes on "
        "from that OP",
        in_a_test(taken_over),
        parameters=LIMITED,
        relayed=("op_applied",),
    ),
    Fault(
        "test-estimator-killed",
        "realtime: a valve test goes on without the estimator; lockstep: all end, each with a "
        "sentence",
        in_a_test(kill_and_restart("estimator"), goes_on=True),
        parameters=LIMITED,
        phases=(Phase.AFTER,),
        ends=LOCKSTEP,
    ),
    Fault(
        "test-plant-killed",
        "realtime: a new run ends the valve test; lockstep: controller and estimator end with "
        "code 0 and a sentence",
        in_a_test(kill_and_restart("plant")),
        parameters=LIMITED,
        phases=(Phase.BEFORE,),
        notices=NO_PV,
        ends=LOCKSTEP,
        silence=math.inf,
        recovery=10.0,
        forgets=True,
    ),
)
