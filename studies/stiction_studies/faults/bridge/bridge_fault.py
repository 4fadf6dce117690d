"""One fault between a control system and its bridge, and what is expected of it."""

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stiction_studies.faults.bridge.bridged_loop import BridgedLoop

NOTICED_WITHIN = 3.0  # s


def nothing(_loop: "BridgedLoop") -> None:
    """Do nothing."""


@dataclasses.dataclass(frozen=True)
class BridgeFault:
    """A fault that comes while the controller has the valves."""

    name: str  # on the command line
    expected: str  # of the loop, in words
    put: "Callable[[BridgedLoop], None]"  # brings it about
    shown: str  # regular expression of what ``/diagnostics`` say of it
    # takes it away again; afterwards the operator grants control once more
    mend: "Callable[[BridgedLoop], None]" = nothing
    by: str = "opcua"  # the node that says it
    within: float = NOTICED_WITHIN  # s until it is said, after it was put
    taken_over: bool = True  # whether the plant's own controllers must take over
    refused: int = 0  # OPs that the plant may refuse though its mode changed long before
    rests: bool = False  # whether the set-points rest, as a valve test wants it
