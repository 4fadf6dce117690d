"""Messages on the topics of the loop that should not be there."""

from collections.abc import Callable, Mapping
from typing import Any

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.terms import Notice, Pace, Phase

REALTIME = (Pace.REALTIME,)
BETWEEN = 0.15  # s between two kinds of junk
REPEATS = 3
FLOOD = 3000
NAN, INFINITE = float("nan"), float("inf")

Kind = Mapping[str, Any]
MALFORMED: tuple[Kind, ...] = (
    {"names": ("NOBODY",), "values": [1.0]},
    {"names": (), "values": []},
    {"values": []},
    {"values": [1.0, 2.0, 3.0, 4.0, 5.0]},
    {"values": NAN},
    {"values": INFINITE},
    {"values": -INFINITE},
)
STAMPS: tuple[Kind, ...] = (
    {"stamp": 0},
    {"offset": -30.0},
    {"offset": -1.0},
    {"offset": -0.3},
    {"offset": 1e5},
    {"offset": 1e9},
    {"stamp": 2**31 * 10**9 - 1},
)


def said(topic: str, kinds: tuple[Kind, ...], **more: Any) -> Callable[[RunningLoop], None]:
    """Return what publishes each of ``kinds`` on ``topic`` a few times."""

    def put(loop: RunningLoop) -> None:
        for kind in kinds:
            for _ in range(REPEATS):
                loop.say(topic, **{**more, **kind})
            loop.wait(BETWEEN)
        loop.probe.silence(topic)

    return put


def wild_pv(loop: RunningLoop) -> None:
    """A PV of 10⁶ ten times, then 0 twice, each for the present sample."""
    for value, count in ((1e6, 10), (0.0, 2)):
        for _ in range(count):
            loop.say("pv", value, offset=loop.step / 1e9 if loop.pace is Pace.REALTIME else 0.0)
            loop.wait_samples(1, 1.0)
    loop.probe.silence("pv")


def wild_sp(loop: RunningLoop) -> None:
    """A set-point of 10⁹ five times."""
    for _ in range(5):
        loop.say("sp", 1e9)
        loop.wait_samples(1, 1.0)
    loop.probe.silence("sp")


def flood(topic: str, **kind: Any) -> Callable[[RunningLoop], None]:
    """Return what publishes thousands of messages at once."""

    def put(loop: RunningLoop) -> None:
        for number in range(FLOOD):
            loop.say(topic, **kind)
            if number % 100 == 99:
                loop.wait(0.02)
        loop.probe.silence(topic)

    return put


def wild_previews(loop: RunningLoop) -> None:
    """Set-points to come that nobody can follow."""
    stamp, names = loop.last("pv").stamp, loop.names("pv")
    row = [50.0] * len(names)
    second = 10**9
    for tags, rows, times in (
        (("NOBODY",), [[1.0]], [second]),
        (names, [row, row], [second, second]),
        (names, [row, row], [2 * second, second]),
        (names, [[]], [second]),
        (names, [[NAN] * len(names), [INFINITE] * len(names)], [second, 2 * second]),
        (names, [[1e9] * len(names)], [second]),
        (names, [], []),
    ):
        for at in (stamp, 0, stamp + 10**6 * second):
            loop.probe.preview(at, tags, rows, times)
        loop.wait(BETWEEN)
    loop.probe.silence("sp_preview")


def strange_clock(loop: RunningLoop) -> None:
    """A second simulated time that runs backwards, stands still, leaps."""
    now = loop.last("pv").stamp
    for number in range(40):
        loop.probe.clock(max(now - number * 10**9, 0))
        loop.probe.clock(now + 10**15)
        loop.wait(0.05)
    loop.probe.silence("/clock")


SEEN = (Notice("controller", "warn"),)

FAULTS = (
    Fault(
        "pv-malformed",
        "a PV with other tags, too few or too many values, NaN or infinity beside the true one "
        "is counted and changes nothing",
        said("pv", MALFORMED),
        notices=SEEN,
    ),
    Fault(
        "pv-wild",
        "PVs of 10⁶ and 0 from another sender move OP no further than the loop itself does",
        wild_pv,
        notices=SEEN,
    ),
    Fault(
        "pv-stamps",
        "a PV of stamp 0, of the past or of the far future is refused and counted",
        said("pv", STAMPS),
        notices=SEEN,
    ),
    Fault(
        "pv-flood",
        "thousands of old PVs do not stop the loop",
        flood("pv", offset=-30.0),
        phases=(Phase.AFTER,),
    ),
    Fault(
        "sp-malformed",
        "a set-point that cannot be read is refused, the last holds",
        said("sp", MALFORMED),
        notices=SEEN,
    ),
    Fault(
        "sp-wild",
        "a set-point out of the range of its instrument is refused, the last holds",
        wild_sp,
        notices=SEEN,
    ),
    Fault(
        "sp-stamps",
        "a set-point with a stamp that fits no sample stops nothing",
        said("sp", STAMPS, values=50.0),
    ),
    Fault(
        "op-applied-junk",
        "an impossible message about the OP in force is refused",
        said("op_applied", (*MALFORMED, *STAMPS, {"values": 1e6, "offset": 1e5})),
        phases=(Phase.AFTER,),
    ),
    Fault(
        "dv-junk",
        "a measured disturbance that the loop does not have changes nothing",
        said("dv", (*MALFORMED, *STAMPS, {"values": 1e9})),
        phases=(Phase.AFTER,),
    ),
    Fault(
        "sp-preview-junk",
        "set-points to come that make no sense are refused",
        wild_previews,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "stiction-junk",
        "frictions that nobody has identified change nothing in the controller",
        said(
            "stiction", (*MALFORMED, *STAMPS, {"names": ("V1.f_s", "V1.f_d"), "values": [60, 59]})
        ),
        phases=(Phase.AFTER,),
    ),
    Fault(
        "clock-junk",
        "a second simulated clock stops neither loop nor recorder",
        strange_clock,
        phases=(Phase.AFTER,),
    ),
)
