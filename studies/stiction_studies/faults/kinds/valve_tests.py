"""What comes between a valve test: the former mode is in force again, without a bump."""

import math
from collections.abc import Callable
from typing import Any

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.kinds.lost_signals import NAN, relayed
from stiction_studies.faults.kinds.stopped_nodes import NO_PV, kill_and_restart
from stiction_studies.faults.loop.rules import instead, late_by
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.terms import Notice, Pace, Phase

REALTIME, LOCKSTEP = (Pace.REALTIME,), (Pace.LOCKSTEP,)
TEST = "valve_test"  # mode of the controller
BEGINS, ENDS = 10.0, 10.0  # s until a test has begun, and has ended after the fault
RESTS = 5  # samples of the test before the fault
AWAY = 2.0  # of the set-point, and of OP in %: well beyond rounding


def in_a_test(
    put: Callable[[RunningLoop], None], goes_on: bool = False
) -> Callable[[RunningLoop], None]:
    """Return what does something to a loop of which the valve is tested.

    Args:
        put: does it.
        goes_on: whether the test goes on, and is then ended by its parameter.
    """

    def whole(loop: RunningLoop) -> None:
        _set(loop, TEST)
        if not loop.wait_until(lambda: loop.known.mode == TEST, BEGINS):
            loop.remark("no valve test began")
            return
        loop.wait_samples(RESTS)
        put(loop)
        if loop.pace is Pace.LOCKSTEP and any(
            node.code is not None for node in loop.nodes.values()
        ):
            return  # all end
        if goes_on:
            if loop.known.mode != TEST:
                loop.remark("the valve test ended")
            _set(loop, "auto")
        if not loop.wait_until(lambda: loop.known.mode != TEST, ENDS):
            loop.remark("the valve test went on")

    return whole


def _set(loop: RunningLoop, mode: str) -> None:
    if loop.probe.set_parameters("controller", {"mode": mode}) != [True]:
        loop.remark(f"the controller did not take mode {mode}")


def by_another(message: Any) -> list[Any]:
    """Let an OP in force be that of someone else."""
    message.header.frame_id = "/operator"
    message.position = moved(list(message.position))
    return [message]


def moved(row: list[float]) -> list[float]:
    """Return the values beside where they were."""
    return [value + AWAY for value in row]


FAULTS = (
    Fault(
        "test-pv-bad",
        "PVs that are NaN end a valve test: OP goes back, the former mode goes on from there",
        in_a_test(relayed("pv", lambda: instead(lambda row: [NAN] * len(row), 8), seconds=1.0)),
        relayed=("pv",),
        notices=(Notice("controller", "warn"),),
    ),
    Fault(
        "test-pv-late",
        "PVs that come two samples late end a valve test",
        in_a_test(relayed("pv", lambda: late_by(2), seconds=2.0)),
        REALTIME,
        relayed=("pv",),
        silence=math.inf,
    ),
    Fault(
        "test-set-point-moved",
        "a move of the set-point ends a valve test",
        in_a_test(relayed("sp", lambda: instead(moved, 20), seconds=1.0)),
        relayed=("sp",),
    ),
    Fault(
        "test-taken-over",
        "an OP in force that is not the controller's ends a valve test, and the control goes on "
        "from that OP",
        in_a_test(relayed("op_applied", lambda: by_another, samples=3)),
        relayed=("op_applied",),
    ),
    Fault(
        "test-estimator-killed",
        "realtime: a valve test goes on without the estimator; lockstep: all end, each with a "
        "sentence",
        in_a_test(kill_and_restart("estimator"), goes_on=True),
        phases=(Phase.AFTER,),
        ends=LOCKSTEP,
    ),
    Fault(
        "test-plant-killed",
        "realtime: a new run ends the valve test; lockstep: controller and estimator end with "
        "code 0 and a sentence",
        in_a_test(kill_and_restart("plant")),
        phases=(Phase.BEFORE,),
        notices=NO_PV,
        ends=LOCKSTEP,
        silence=math.inf,
        recovery=10.0,
        forgets=True,
    ),
)
