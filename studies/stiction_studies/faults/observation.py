"""What was seen of a running loop while a fault was put into it."""

import dataclasses
from collections.abc import Mapping

from stiction_studies.faults.terms import Phase

Values = tuple[float, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Sampled:
    """One message with a stamp.

    Attributes:
        wall: when it came, s of a clock that only rises.
        stamp: sample it belongs to, ns.
        values: in the order of the tags.
    """

    wall: float
    stamp: int
    values: Values


@dataclasses.dataclass(frozen=True, slots=True)
class Shown:
    """One diagnostic status of a node: when it came, and what it says."""

    wall: float
    node: str
    level: str
    text: str


@dataclasses.dataclass(frozen=True)
class Known:
    """What the controller said last of its mode and of the frictions it knows, in %."""

    mode: str = ""
    friction: Mapping[str, float] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Ended:
    """How a node ended.

    Attributes:
        code: exit code, negative for a signal.
        log: what it has written since the fault began.
        by_fault: whether the fault itself has ended it.
    """

    code: int
    log: str
    by_fault: bool = False


@dataclasses.dataclass(frozen=True)
class BagFound:
    """What the bag of the run holds.

    Attributes:
        expected: pv and op_applied that were seen.
        missing: of these, not in the bag.
        reason: why it cannot be read; empty when it can.
    """

    expected: int = 0
    missing: int = 0
    reason: str = ""


@dataclasses.dataclass(frozen=True)
class Observation:
    """Everything that is judged of one case.

    Attributes:
        phase: whether the controller knew the friction.
        period: wall time of a sample, s; 0 in lockstep.
        step: ns between two samples.
        begun, over, until: wall times: the fault, its end, the end of looking.
        applied: OPs that the plant has applied.
        sent: OPs of the commanding node.
        pv: measurements.
        statuses: of all nodes.
        before, after: what the controller knew when the fault came, and at the end.
        ended: of every node that has ended by itself before the loop was stopped.
        logs: of every node.
        bag: of the run.
        remarks: what the fault itself found wrong, and what went wrong at the start.
    """

    phase: Phase
    period: float
    step: int
    begun: float
    over: float
    until: float
    applied: tuple[Sampled, ...] = ()
    sent: tuple[Sampled, ...] = ()
    pv: tuple[Sampled, ...] = ()
    statuses: tuple[Shown, ...] = ()
    before: Known = Known()
    after: Known = Known()
    ended: Mapping[str, Ended] = dataclasses.field(default_factory=dict)
    logs: Mapping[str, str] = dataclasses.field(default_factory=dict)
    bag: BagFound = BagFound()
    remarks: tuple[str, ...] = ()
