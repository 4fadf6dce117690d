"""Nodes that stand still, die, come back."""

import math
from collections.abc import Callable

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.observation import Sampled
from stiction_studies.faults.terms import Bag, Notice, Pace, Phase

REALTIME = (Pace.REALTIME,)
LOCKSTEP = (Pace.LOCKSTEP,)
PAUSE = 10.0  # s, long enough for a backlog
SHORT_PAUSE = 4.0  # s, long enough for the diagnostics
AWAY = 4.0  # s
RESTARTS = 10
START = 30.0  # s for a node to be there again
SAME_OP = 1.0  # %, between the OP in force and the first of a new controller
DEACTIVATE, ACTIVATE = 4, 3  # of lifecycle_msgs/Transition
STOPPED = (Notice("plant", "error", REALTIME),)
NO_PV = (Notice("controller", "error", REALTIME), Notice("estimator", "error", REALTIME))


def pause(*names: str, seconds: float = PAUSE) -> Callable[[RunningLoop], None]:
    """Return what pauses nodes for a while and lets them go on."""

    def put(loop: RunningLoop) -> None:
        for name in names:
            loop.nodes[name].pause()
        loop.wait(seconds)
        for name in names:
            loop.nodes[name].go_on()

    return put


def stutter(loop: RunningLoop) -> None:
    """Pause the controller again and again for about three samples."""
    for _ in range(12):
        loop.nodes["controller"].pause()
        loop.wait(3 * loop.period or 0.1)
        loop.nodes["controller"].go_on()
        loop.wait(0.25)


def kill(name: str) -> Callable[[RunningLoop], None]:
    """Return what kills a node for good."""

    def put(loop: RunningLoop) -> None:
        loop.nodes[name].kill()

    return put


def kill_and_restart(name: str) -> Callable[[RunningLoop], None]:
    """Return what kills a node and starts it again after a while."""

    def put(loop: RunningLoop) -> None:
        loop.nodes[name].kill()
        loop.wait(AWAY)
        if loop.pace is Pace.LOCKSTEP:
            return  # the others end; there is nothing to join
        if name == "controller":
            _restart_controller(loop, 1)
        else:
            loop.restart(name)
            _wait_for_samples(loop)

    return put


def restart_controller(loop: RunningLoop) -> None:
    """Kill and start the controller ten times in a row."""
    for number in range(RESTARTS):
        loop.nodes["controller"].kill()
        _restart_controller(loop, number + 1)
        loop.wait(0.5)


def deactivate(name: str) -> Callable[[RunningLoop], None]:
    """Return what deactivates a node and activates it again."""

    def put(loop: RunningLoop) -> None:
        if not loop.probe.change_state(name, DEACTIVATE):
            loop.remark(f"{name} did not let itself be deactivated")
        loop.wait(AWAY)
        before, sent = loop.last("op_applied"), len(loop.heard("op"))
        if not loop.probe.change_state(name, ACTIVATE):
            loop.remark(f"{name} did not let itself be activated again")
        if name == "controller" and loop.wait_until(lambda: len(loop.heard("op")) > sent, START):
            _compare(loop, before, loop.heard("op")[sent], 1)

    return put


def _restart_controller(loop: RunningLoop, number: int) -> None:
    """Start the controller and compare its first OP with the one in force."""
    loop.wait_samples(2)  # what it had sent before it died has been applied
    in_force, sent = loop.last("op_applied"), len(loop.heard("op"))
    loop.restart("controller")
    if not loop.wait_until(lambda: len(loop.heard("op")) > sent, START):
        loop.remark(f"start {number} of the controller: no OP within {START:g} s")
        return
    _compare(loop, in_force, loop.heard("op")[sent], number)


def _compare(loop: RunningLoop, in_force: Sampled, first: Sampled, number: int) -> None:
    pairs = zip(in_force.values, first.values, strict=True)
    move = max(abs(b - a) for a, b in pairs)
    if not move <= SAME_OP:
        loop.remark(f"start {number} of the controller: its first OP is {move:.2f} % away")


def _wait_for_samples(loop: RunningLoop) -> None:
    if not loop.wait_samples(3, START):
        loop.remark(f"no PV within {START:g} s of the restart")


FAULTS = (
    Fault(
        "controller-paused",
        "OP stays where it is; then the controller answers the newest sample, passes over the "
        "backlog and keeps the friction in force",
        pause("controller"),
        REALTIME,
        notices=STOPPED,
        silence=math.inf,
    ),
    Fault(
        "controller-paused-in-lockstep",
        "the plant waits; then the run goes on unchanged",
        pause("controller", seconds=SHORT_PAUSE),
        LOCKSTEP,
        silence=math.inf,
    ),
    Fault(
        "controller-stutters",
        "late samples are passed over; a late OP does not count as a stuck valve",
        stutter,
        REALTIME,
    ),
    Fault(
        "plant-paused",
        "controller and estimator say that PV has stopped, and go on with the plant",
        pause("plant", seconds=SHORT_PAUSE),
        notices=NO_PV,
        silence=math.inf,
    ),
    Fault(
        "estimator-paused",
        "the control goes on; the estimator comes back by itself",
        pause("estimator", seconds=SHORT_PAUSE),
        REALTIME,
    ),
    Fault(
        "recorder-paused",
        "the control goes on; the bag may have a hole and can be read",
        pause("recorder"),
        bag=Bag.READABLE,
    ),
    Fault(
        "all-paused",
        "all nodes go on where they were, without a jump of OP",
        pause("plant", "controller", "estimator", "recorder", seconds=SHORT_PAUSE),
        silence=math.inf,
    ),
    Fault(
        "controller-killed",
        "realtime: OP stays and a new controller continues from it; lockstep: all end, each "
        "with a sentence, the plant with code 1",
        kill_and_restart("controller"),
        notices=STOPPED,
        ends=LOCKSTEP,
        silence=math.inf,
        forgets=True,
    ),
    Fault(
        "controller-restarted-ten-times",
        "each first OP is within 1 % of the OP in force",
        restart_controller,
        REALTIME,
        silence=math.inf,
        forgets=True,
    ),
    Fault(
        "controller-deactivated",
        "OP stays; after the activation it continues from there, and what came meanwhile is "
        "not answered",
        deactivate("controller"),
        notices=STOPPED,
        silence=math.inf,
    ),
    Fault(
        "plant-killed",
        "realtime: the new run, whose stamps are older, is taken up; lockstep: controller and "
        "estimator end with code 0 and a sentence",
        kill_and_restart("plant"),
        notices=NO_PV,
        ends=LOCKSTEP,
        silence=math.inf,
        recovery=10.0,
        forgets=True,
    ),
    Fault(
        "estimator-killed",
        "realtime: the control goes on and a new estimator joins; lockstep: all end, each with "
        "a sentence, the plant with code 1",
        kill_and_restart("estimator"),
        ends=LOCKSTEP,
    ),
    Fault(
        "estimator-deactivated",
        "the control goes on; the estimator begins its window anew",
        deactivate("estimator"),
        REALTIME,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "recorder-killed",
        "the control goes on; the bag can be read up to there",
        kill("recorder"),
        bag=Bag.READABLE,
    ),
)
