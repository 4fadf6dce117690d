"""The terms of the suite: pace, phase, what is expected of the bag and of the diagnostics."""

import dataclasses
import enum


class Pace(enum.StrEnum):
    """Who waits for whom."""

    REALTIME = "realtime"
    LOCKSTEP = "lockstep"


class Phase(enum.StrEnum):
    """Whether the controller knows the friction when the fault comes."""

    BEFORE = "before"
    AFTER = "after"


class Bag(enum.StrEnum):
    """What is expected of the bag of the run."""

    WHOLE = "whole"  # every pv and op_applied that was seen, and it can be read
    READABLE = "readable"  # what it holds can be read
    LOST = "lost"  # it was taken away


BOTH_PACES = (Pace.REALTIME, Pace.LOCKSTEP)
BOTH_PHASES = (Phase.BEFORE, Phase.AFTER)
LEVELS = ("ok", "warn", "error")


@dataclasses.dataclass(frozen=True)
class Notice:
    """A diagnostic that must show the fault, and end with it unless it ``stays``."""

    node: str  # whose status
    level: str  # warn or error; a worse one will do
    paces: tuple[Pace, ...] = BOTH_PACES  # in which it is expected
    stays: bool = False  # whether it may be shown for as long as the run lasts
