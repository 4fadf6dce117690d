"""One fault: what is done to a running loop, and what is expected of it."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.terms import BOTH_PACES, BOTH_PHASES, Bag, Notice, Pace, Phase


@dataclasses.dataclass(frozen=True)
class Fault:
    """One row of the suite."""

    name: str  # by which ``stiction faults --only`` knows it
    expected: str  # outcome, one sentence
    # does it to a running loop and returns when it is over; what it finds wrong by itself it
    # tells by :meth:`.RunningLoop.remark`
    put: Callable[[RunningLoop], None]
    # paces, phases: in which it means something
    paces: tuple[Pace, ...] = BOTH_PACES
    phases: tuple[Phase, ...] = BOTH_PHASES
    notices: tuple[Notice, ...] = ()  # diagnostics that must show it
    # paces in which the loop may end with a clear sentence instead of going on
    ends: tuple[Pace, ...] = ()
    # longest time without a new OP while it lasts, s; infinite where it stops the loop by its
    # nature
    silence: float = 1.0
    recovery: float = 5.0  # s from its end until OP must flow again
    bag: Bag = Bag.WHOLE  # what is expected of the bag
    # whether the controller may take a friction before the swap, so that its moves are those
    # of afterwards
    swaps: bool = False
    forgets: bool = False  # whether the controller may lose what it knew of the friction
    from_start: bool = False  # it is there from the start, and ``put`` has nothing to do
    # of nodes, in place of the usual ones
    parameters: Mapping[str, Mapping[str, Any]] = dataclasses.field(default_factory=dict)
    # topics that go through the suite, which may lose or change their messages
    relayed: tuple[str, ...] = ()

    @property
    def cases(self) -> tuple[tuple[Pace, Phase], ...]:
        """Pace and phase of every run of it."""
        return tuple((pace, phase) for pace in self.paces for phase in self.phases)

    def noticed_in(self, pace: Pace) -> tuple[Notice, ...]:
        """Return the diagnostics that are expected in ``pace``."""
        return tuple(notice for notice in self.notices if pace in notice.paces)

    @property
    def stops(self) -> bool:
        """Whether the loop stands still while it lasts."""
        return math.isinf(self.silence)


def nothing(_loop: RunningLoop) -> None:
    """Do nothing: the fault is there already."""
