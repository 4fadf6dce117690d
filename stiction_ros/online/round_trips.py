"""How long the loop takes to answer: wall time from a PV to the OP of its sample."""

import math

import numpy as np

SHORTEST = 1e-6  # s, the lower end of what is told apart
GROWTH = 1.01  # from one bin to the next: figures are right to 1 %
BINS = 2400  # up to 6 hours
OPEN = 1000  # samples whose OP is awaited; older ones count as unanswered
FIGURES = {"p50": 0.5, "p99": 0.99, "p999": 0.999}


class RoundTrips:
    """Counts the times of all samples, however many, in bins that grow by 1 %."""

    def __init__(self) -> None:
        """Start without any."""
        self._bins = np.zeros(BINS, dtype=np.int64)
        self._open: dict[int, float] = {}
        self.asked = self.answered = 0
        self.longest = 0.0

    def ask(self, stamp: int, now: float) -> None:
        """Note that the PV of ``stamp`` goes out at ``now``, s; again changes nothing."""
        if stamp in self._open:
            return
        self.asked += 1
        self._open[stamp] = now
        if len(self._open) > OPEN:
            del self._open[next(iter(self._open))]

    def answer(self, stamp: int, now: float) -> None:
        """Note that the OP of ``stamp`` is there at ``now``, s; only the first one counts."""
        begin = self._open.pop(stamp, None)
        if begin is None:
            return
        seconds = max(now - begin, SHORTEST)
        self.answered += 1
        self.longest = max(self.longest, seconds)
        place = math.ceil(math.log(seconds / SHORTEST) / math.log(GROWTH))
        self._bins[min(max(place, 0), BINS - 1)] += 1

    def milliseconds(self) -> dict[str, float]:
        """Return p50, p99, p999 (each at most 1 % too large) and max, ms; empty without any."""
        if not self.answered:
            return {}
        ranks = np.cumsum(self._bins)
        found = {}
        for name, share in FIGURES.items():
            place = int(np.searchsorted(ranks, max(math.ceil(share * self.answered), 1)))
            found[name] = 1e3 * min(SHORTEST * GROWTH**place, self.longest)
        return found | {"max": 1e3 * self.longest}
