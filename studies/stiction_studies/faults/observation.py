"""What was seen of a running loop while a fault was put into it."""

import dataclasses
from collections.abc import Mapping

from stiction_studies.faults.terms import Phase

Values = tuple[float, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Sampled:
    """One message with a stamp."""

    wall: float  # when it came, s of a clock that only rises
    stamp: int  # sample it belongs to, ns
    values: Values  # in the order of the tags


@dataclasses.dataclass(frozen=True, slots=True)
class Shown:
    """One diagnostic status of a node: when it came, and what it says."""

    wall: float
    node: str
    level: str
    text: str


@dataclasses.dataclass(frozen=True)
class Known:
    """What the controller said last of its mode, since when (ns), and of its frictions, in %."""

    mode: str = ""
    friction: Mapping[str, float] = dataclasses.field(default_factory=dict)
    since: int = dataclasses.field(default=0, compare=False)


@dataclasses.dataclass(frozen=True)
class Ended:
    """How a node ended."""

    code: int  # exit code, negative for a signal
    log: str  # what it has written since the fault began
    by_fault: bool = False  # whether the fault itself has ended it


@dataclasses.dataclass(frozen=True)
class BagFound:
    """What the bag of the run holds."""

    expected: int = 0  # pv and op_applied that were seen
    missing: int = 0  # of these, not in the bag
    reason: str = ""  # why it cannot be read; empty when it can


@dataclasses.dataclass(frozen=True)
class Observation:
    """Everything that is judged of one case."""

    phase: Phase  # whether the controller knew the friction
    period: float  # wall time of a sample, s; 0 in lockstep
    step: int  # ns between two samples
    # begun, over, until: wall times: the fault, its end, the end of looking
    begun: float
    over: float
    until: float
    applied: tuple[Sampled, ...] = ()  # OPs that the plant has applied
    sent: tuple[Sampled, ...] = ()  # OPs of the commanding node
    pv: tuple[Sampled, ...] = ()  # measurements
    statuses: tuple[Shown, ...] = ()  # of all nodes
    # before, after: what the controller knew when the fault came, and at the end
    before: Known = Known()
    after: Known = Known()
    # of every node that has ended by itself before the loop was stopped
    ended: Mapping[str, Ended] = dataclasses.field(default_factory=dict)
    logs: Mapping[str, str] = dataclasses.field(default_factory=dict)  # of every node
    bag: BagFound = BagFound()  # of the run
    # what the fault itself found wrong, and what went wrong at the start
    remarks: tuple[str, ...] = ()
