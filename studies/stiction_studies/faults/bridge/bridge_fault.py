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
    """A fault that comes while the controller has the valves.

    Attributes:
        name: on the command line.
        expected: of the loop, in words.
        put: brings it about.
        mend: takes it away again; afterwards the operator grants control once more.
        shown: regular expression of what ``/diagnostics`` say of it.
        by: the node that says it.
        within: s until it is said, after it was put.
        taken_over: whether the plant's own controllers must take over.
        refused: OPs that the plant may refuse though its mode changed long before.
    """

    name: str
    expected: str
    put: "Callable[[BridgedLoop], None]"
    shown: str
    mend: "Callable[[BridgedLoop], None]" = nothing
    by: str = "opcua"
    within: float = NOTICED_WITHIN
    taken_over: bool = True
    refused: int = 0
