"""Messages of the loop that are lost, late, changed or exchanged on their way."""

import math
from collections.abc import Callable

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.loop.rules import Rule, drop_all, every, instead, late_by, swapped
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.terms import Notice, Pace, Phase

REALTIME = (Pace.REALTIME,)
NAN = float("nan")
LONG = 5.0  # s


def relayed(
    topic: str, make: Callable[[], Rule], samples: int = 0, seconds: float = 0.0
) -> Callable[[RunningLoop], None]:
    """Return what changes the messages of ``topic`` for some samples or seconds."""

    def put(loop: RunningLoop) -> None:
        loop.probe.rule(topic, make())
        if samples:
            loop.wait(max(samples * loop.period, 0.2))
        loop.wait(seconds)
        loop.probe.rule(topic)

    return put


def wild(loop: RunningLoop) -> None:
    """Let the instrument show 10⁶ ten times, then 0 twice."""
    loop.probe.rule("pv", instead(lambda row: [1e6] * len(row), 10))
    loop.wait_samples(10)
    loop.probe.rule("pv", instead(lambda row: [0.0] * len(row), 2))
    loop.wait_samples(2)
    loop.probe.rule("pv")


BAD = (Notice("controller", "warn"),)
NO_PV = (Notice("controller", "error", REALTIME), Notice("estimator", "error", REALTIME))

FAULTS = (
    Fault(
        "pv-lost",
        "three PVs in succession that do not come are bridged by the plan",
        relayed("pv", lambda: drop_all, samples=3),
        relayed=("pv",),
    ),
    Fault(
        "pv-gone",
        "without PV the controller follows its plan, then holds OP; controller and estimator "
        "report it; OP does not jump when PV returns",
        relayed("pv", lambda: drop_all, seconds=LONG),
        relayed=("pv",),
        notices=NO_PV,
        silence=math.inf,
    ),
    Fault(
        "pv-now-and-then",
        "every fifth PV is lost: the control goes on",
        relayed("pv", lambda: every(5), seconds=LONG),
        REALTIME,
        relayed=("pv",),
    ),
    Fault(
        "pv-late",
        "PVs that come two samples late do not make a valve look stuck",
        relayed("pv", lambda: late_by(2), seconds=LONG),
        REALTIME,
        relayed=("pv",),
        silence=math.inf,
    ),
    Fault(
        "pv-swapped",
        "of two PVs that come in the wrong order the older is refused",
        relayed("pv", swapped, seconds=LONG),
        REALTIME,
        relayed=("pv",),
    ),
    Fault(
        "pv-bad",
        "a PV that is NaN has bad quality: the controller follows its plan",
        relayed("pv", lambda: instead(lambda row: [NAN] * len(row), 8), seconds=1.0),
        relayed=("pv",),
        notices=BAD,
    ),
    Fault(
        "pv-spikes",
        "an instrument that shows 10⁶ and then 0 moves OP no further than the loop itself does",
        wild,
        relayed=("pv",),
        notices=BAD,
    ),
    Fault(
        "sp-lost",
        "realtime: the last set-point holds; lockstep: the plant sends the set-points again",
        relayed("sp", lambda: drop_all, seconds=1.0),
        relayed=("sp",),
        silence=3.0,
    ),
    Fault(
        "sp-late",
        "the old set-point holds until the late one comes",
        relayed("sp", lambda: late_by(2), seconds=LONG),
        REALTIME,
        relayed=("sp",),
    ),
    Fault(
        "op-lost",
        "the plant holds OP and reports it; a lost OP does not count as a stuck valve",
        relayed("op", lambda: drop_all, seconds=LONG),
        relayed=("op",),
        notices=(Notice("plant", "error", REALTIME),),
        silence=math.inf,
    ),
    Fault(
        "op-late",
        "OPs that come three samples late are counted and reported; they do not count as a "
        "stuck valve",
        relayed("op", lambda: late_by(3), seconds=LONG),
        REALTIME,
        relayed=("op",),
        notices=(Notice("plant", "warn"),),
        silence=math.inf,
    ),
    Fault(
        "op-applied-lost",
        "without messages about the OP in force the controller goes on with its own OP",
        relayed("op_applied", lambda: drop_all, seconds=LONG),
        REALTIME,
        relayed=("op_applied",),
        phases=(Phase.AFTER,),
        silence=math.inf,
    ),
)
