"""Beats that tell who lives: ours with our number in them, theirs, and those of strangers."""

IDENTITIES = 1 << 15  # numbers of writers
COUNT = 1 << 16  # beats until the count begins anew


def identity_of(beat: float) -> int:
    """Return the number of the writer of a beat; 0 is nobody."""
    return int(beat) // COUNT if 0 <= beat < IDENTITIES * COUNT else -1


class OwnBeat:
    """A number that rises with each beat and bears ours, so that another writer is seen.

    A beat is ``identity`` · 65 536 + count, a whole number of 31 bits.
    """

    def __init__(self, identity: int) -> None:
        """Start; ``identity`` in 1 … 32 767, drawn at random by the caller."""
        self.identity = identity
        self._count = 0

    def next(self) -> int:
        """Return the next beat."""
        self._count = (self._count + 1) % COUNT
        return self.identity * COUNT + self._count


class HeardBeat:
    """Someone's beat: when it changed last."""

    def __init__(self) -> None:
        """Start without a beat."""
        self._value: float | None = None
        self._changed_at: float | None = None

    def hear(self, value: float, now: float, first: bool) -> None:
        """Take in a beat at ``now``, s; the ``first`` report of a subscription is no change."""
        if value != self._value:
            self._value = value
            if not first:
                self._changed_at = now

    def silent_for(self, now: float, since: float) -> float:
        """Return s since the last beat, or since ``since`` when that is later."""
        return now - max(since, self._changed_at if self._changed_at is not None else since)

    def beats(self, now: float, within: float) -> bool:
        """Return whether it has changed in the last ``within`` s."""
        return self._changed_at is not None and now - self._changed_at <= within
