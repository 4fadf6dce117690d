"""Which OP a plant or driver takes: from one commander, for the present sample, once."""

import dataclasses
import enum
from collections import Counter

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.online.input.sample_grid import keep

OLDEST = 3  # samples: an OP that is later than this was meant for another state of the loop
KEPT = 1000  # messages whose sample has not come
RECENT = 10  # samples after which an OP in force is old news
SILENT = 10  # samples without a word after which nobody tells any more


@dataclasses.dataclass(frozen=True)
class Given:
    """What the valves were given at one sample."""

    op: FloatArray | None = None  # shape (m,), %; None when nobody tells
    known: bool = True  # whether it is known; without ``op`` it is then the controller's own OP
    # whether it comes from the controller, as limited or as late as it may be, and not from someone
    # else who has the valves
    ours: bool = True


class AppliedOp:
    """Keeps what ``op_applied`` says until its sample is asked for."""

    def __init__(self, step: int) -> None:
        """Start without any; ``step`` in ns from one sample to the next."""
        self._step = step
        self._told: dict[int, Given] = {}
        self._silent = SILENT

    def add(self, stamp: int, op: FloatArray, ours: bool = True) -> None:
        """Take in the OP, shape (m,), that acts at ``stamp``, and whether it is ours."""
        self._told.pop(stamp, None)
        keep(self._told, stamp, Given(op, ours=ours), KEPT)

    def in_force(self, stamp: int) -> FloatArray | None:
        """Return the newest OP before the sample at ``stamp``, or None."""
        early, late = stamp - RECENT * self._step, stamp - self._step // 2
        found = [told for told in self._told if early <= told < late]
        return self._told[max(found)].op if found else None

    def before(self, stamp: int, own_in_time: bool) -> Given:
        """Return what was given at the sample before that of ``stamp``, ns, and forget older ones.

        The controller's ``own`` OP may have gone out within a period, or later.
        """
        half = self._step // 2
        wanted = [told for told in self._told if abs(told - stamp + self._step) <= half]
        given = self._told[max(wanted)] if wanted else None
        for old in [told for told in self._told if told < stamp - half]:
            del self._told[old]
        if given is not None:
            self._silent = 0
            return given
        self._silent = min(self._silent + 1, SILENT)
        return Given(None, own_in_time and self._silent >= SILENT)


class Reception(enum.Enum):
    """What became of one OP."""

    TAKEN = "taken"
    LATE = "late"  # taken, though its sample had passed
    REPEATED = "repeated"  # not newer than the last one taken: the first OP of a sample wins
    NAME = "name"
    TAGS = "tags"
    NUMBER = "number"
    PAST = "past"
    FUTURE = "future"


class OpPort:
    """Judges the OPs that a plant or driver is sent, and counts what became of them.

    Attributes:
        commander: full name of the node that commands; empty before the first.
        counts: by :class:`Reception`.
    """

    def __init__(self, commander: str, step: int, *, exact: bool) -> None:
        """Begin.

        Args:
            commander: full name of the only node that may command; empty for the first that does.
            step: from one sample to the next, ns.
            exact: whether only the OP that bears the stamp of the present sample is taken.
        """
        self._step, self._exact = step, exact
        self.commander = commander
        self.counts: Counter[Reception] = Counter()
        self._last: int | None = None

    def judge(self, sender: str, stamp: int, op: FloatArray | None, present: int) -> Reception:
        """Return whether an OP, None for a wrong one, is taken for a ``stamp``, ns."""
        found = self._reception(sender, stamp, op, present)
        self.counts[found] += 1
        if found in (Reception.TAKEN, Reception.LATE):
            self._last, self.commander = stamp, sender
        return found

    def _reception(self, sender: str, stamp: int, op: FloatArray | None, present: int) -> Reception:
        exact, step = self._exact, self._step
        if not sender or sender != (self.commander or sender):
            return Reception.NAME
        if op is None:
            return Reception.TAGS
        if not np.isfinite(op).all():
            return Reception.NUMBER
        if stamp > present + (0 if exact else step // 2):
            return Reception.FUTURE
        if self._last is not None and stamp <= self._last:
            return Reception.REPEATED
        if stamp < present - (0 if exact else OLDEST * step):
            return Reception.PAST
        return Reception.LATE if stamp <= present - (step - step // 2) else Reception.TAKEN

    def complaint(self, found: Reception, sender: str) -> str:
        """Return what is wrong with an OP in one sentence; empty when nothing is."""
        return {
            Reception.LATE: "op comes after its sample has passed",
            Reception.NAME: f"op of {sender or 'a node that bears no name'} is refused, "
            f"{self.commander or 'a named node'} commands",
            Reception.TAGS: f"op of {sender} without a value for each valve is refused",
            Reception.NUMBER: f"op of {sender} that is not finite is refused",
            Reception.PAST: f"op of {sender} for a sample long past is refused",
            Reception.FUTURE: f"op of {sender} for a sample to come is refused",
        }.get(found, "")
