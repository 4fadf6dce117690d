"""How long the loop takes to answer: wall time from a PV to the OP of its sample."""

from collections import deque

import numpy as np

from stiction_ros.online.input.sample_grid import keep

OPEN = 1000  # samples whose OP is awaited; older ones count as unanswered
KEPT = 20_000  # the latest answered samples, of which the figures tell
FIGURES = {"p50": 0.5, "p99": 0.99, "p999": 0.999}
LATE = 0.5  # of a period: a tick that is later would come too close to the next


class RoundTrips:
    """Times of the latest samples, and how many of all were asked and answered."""

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=KEPT)
        self._open: dict[int, float] = {}
        self.asked = self.answered = 0
        self.longest = 0.0

    def ask(self, stamp: int, now: float) -> None:
        """Note that the PV of ``stamp`` goes out at ``now``, s; again changes nothing."""
        if stamp in self._open:
            return
        self.asked += 1
        keep(self._open, stamp, now, OPEN)

    def answer(self, stamp: int, now: float) -> None:
        """Note that the OP of ``stamp`` is there at ``now``, s; only the first one counts."""
        begin = self._open.pop(stamp, None)
        if begin is None:
            return
        self.answered += 1
        self.longest = max(self.longest, now - begin)
        self._seconds.append(now - begin)

    def milliseconds(self) -> dict[str, float]:
        """Return p50, p99, p999 and the maximum of all, ms; empty without any."""
        if not self.answered:
            return {}
        shares = 1e3 * np.quantile(self._seconds, [*FIGURES.values()], method="inverted_cdf")
        return {**dict(zip(FIGURES, shares.tolist(), strict=True)), "max": 1e3 * self.longest}


class TickGrid:
    """Ticks a period apart, never less than half of one.

    A tick that comes late by more than half a period begins the grid anew, so that whoever
    answers a sample has half a period at least before the next. What is lost that way is not
    made up for: simulated time falls behind the wall clock.

    Attributes:
        missed: ticks by which it has fallen behind.
    """

    def __init__(self) -> None:
        self.missed = 0.0

    def begin(self, period: float, now: float) -> None:
        """Begin anew at ``now``, s; ``period`` in the seconds of the same clock."""
        self.period, self.due = period, now + period

    def tick(self, now: float) -> bool:
        """Take in a tick at ``now``, s; return whether the grid begins anew with it."""
        late = (now - self.due) / self.period
        if late <= LATE:
            self.due += self.period
            return False
        self.missed += late
        self.due = now + self.period
        return True
