"""Made-up observations of a loop, good until a test spoils them."""

import dataclasses
from typing import Any

from stiction_studies.faults.fault import Fault, nothing
from stiction_studies.faults.observation import BagFound, Known, Observation, Sampled, Shown
from stiction_studies.faults.terms import Notice, Pace, Phase

PERIOD = 0.04
STEP = 10**9
BEGUN, OVER, UNTIL = 104.0, 108.0, 114.0
ALLOWED = 2.0
FRICTION = Known("embedding", {"V1.f_s": 5.0, "V1.f_d": 2.0})


def fault(**changes: Any) -> Fault:
    return Fault("made-up", "nothing happens", nothing, **changes)


def noticed(level: str = "error") -> tuple[Notice, ...]:
    return (Notice("plant", level),)


def samples(first: float = 100.0, last: float = UNTIL) -> tuple[Sampled, ...]:
    """A sample every 40 ms, with an OP that swings slowly."""
    count = round((last - first) / PERIOD)
    begin = round((first - 100.0) / PERIOD)
    return tuple(
        Sampled(first + k * PERIOD, (begin + k + 1) * STEP, (50.0 + 0.1 * ((begin + k) % 7),))
        for k in range(count)
    )


def status(wall: float, level: str, node: str = "plant") -> Shown:
    return Shown(wall, node, level, "")


def statuses(*told: tuple[float, str]) -> tuple[Shown, ...]:
    """One status of the plant a second: ok, save where ``told`` otherwise."""
    found = [status(100.5 + k, "ok") for k in range(14)]
    levels = dict(told)
    return tuple(
        dataclasses.replace(one, level=levels[one.wall]) if one.wall in levels else one
        for one in found
    )


def observation(**changes: Any) -> Observation:
    run = samples()
    sent = tuple(dataclasses.replace(one, wall=one.wall - 0.03) for one in run)
    seen = Observation(
        Phase.AFTER,
        PERIOD,
        STEP,
        BEGUN,
        OVER,
        UNTIL,
        applied=run,
        sent=sent,
        pv=run,
        statuses=statuses(),
        before=FRICTION,
        after=FRICTION,
        logs={"plant": "plant is ready\n"},
        bag=BagFound(2 * len(run), 0),
    )
    return dataclasses.replace(seen, **changes)


REALTIME, LOCKSTEP = Pace.REALTIME, Pace.LOCKSTEP
