"""When samples are due on the wall clock: a grid that a late tick begins anew."""

LATE = 0.5  # of a period: a tick that is later would come too close to the next


class TickGrid:
    """Ticks a period apart, never less than half of one.

    A tick that comes late by more than half a period begins the grid anew, so that whoever
    answers a sample has half a period at least before the next. What is lost that way is not
    made up for: simulated time falls behind the wall clock, and :attr:`missed` tells by how much.

    Attributes:
        period: between two ticks, s.
        due: when the next one is, s of the clock that is handed in.
        behind: by how much the grid has slipped, s.
    """

    def __init__(self, period: float, now: float) -> None:
        """Begin at ``now``; ``period`` in the seconds of the same clock."""
        self.period = period
        self.due = now + period
        self.behind = 0.0

    @property
    def missed(self) -> int:
        """Whole ticks by which the grid has fallen behind."""
        return int(self.behind / self.period)

    def tick(self, now: float) -> bool:
        """Take in a tick at ``now``, s; return whether the grid begins anew with it."""
        late = now - self.due
        if late <= LATE * self.period:
            self.due += self.period
            return False
        self.behind += late
        self.due = now + self.period
        return True
