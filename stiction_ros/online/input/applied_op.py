"""What the valves were really given, as far as anyone tells."""

import dataclasses

from stiction_ros.effects.behaviour import FloatArray

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
        self._told[stamp] = Given(op, ours=ours)
        if len(self._told) > KEPT:
            del self._told[next(iter(self._told))]

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
