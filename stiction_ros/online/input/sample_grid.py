"""Stamps and numbers of the samples of a run, and what stamps that do not fit may mean."""

from collections import deque
from typing import TypeVar

T = TypeVar("T")

SUCCESSION = 10  # refused stamps that rise make a new run
FOLLOWED = 8  # samples after which most of a shift of the stamps is followed
INTERVALS = 9  # of which the middle one tells how fast samples really come
LEAST_INTERVALS = 3


def keep(waiting: dict[int, T], stamp: int, value: T, most: int) -> None:
    """Keep a value until its stamp is asked for; of more than ``most`` the oldest is let go."""
    waiting[stamp] = value
    if len(waiting) > most:
        del waiting[next(iter(waiting))]


class SampleGrid:
    """Numbers samples from 0 on; stamps may lie up to half a sample beside the grid.

    The grid follows stamps that shift slowly, as those of a clock that runs a little fast.
    Numbers go on when a new run begins.
    """

    def __init__(self, step: int) -> None:
        """Start before the first sample; ``step`` in ns."""
        self.step = step
        self.number = -1
        self.stamp = 0

    def begin(self, stamp: int) -> None:
        """Let the next sample have ``stamp``, whatever was before."""
        self.number += 1
        self.stamp = stamp

    def advance(self, stamp: int | None) -> None:
        """Go to the next sample, whose stamp came or is that of the grid (None)."""
        self.number += 1
        self.stamp += self.step
        if stamp is not None:
            self.stamp += int((stamp - self.stamp) / FOLLOWED)

    def ahead(self, stamp: int) -> int:
        """Return how many samples ``stamp`` is after the present one."""
        return (stamp - self.stamp + self.step // 2) // self.step

    def stamp_of(self, number: int) -> int:
        """Return the stamp of a sample of the present run, ns."""
        return self.stamp + (number - self.number) * self.step


class Succession:
    """Refused stamps in succession; enough of them that rise belong to a new run.

    Attributes:
        last: the stamp counted last, None for none.
    """

    def __init__(self, standing: bool) -> None:
        """Start without any; ``standing``: a stamp that is shown again counts as well."""
        self._standing = standing
        self.last: int | None = None
        self._count = 0

    def clear(self) -> None:
        """Begin to count anew: a stamp was accepted."""
        self.last, self._count = None, 0

    def add(self, stamp: int, follows: bool) -> bool:
        """Count a refused stamp, ns; tell whether it is that of a new run."""
        last = self.last
        rises = last is not None and (stamp > last or (self._standing and stamp == last))
        self._count = self._count + 1 if rises and follows else 1
        self.last = stamp
        return self._count >= SUCCESSION


class Pace:
    """How long a sample takes by the receiver's clock: as set, or as seen if that is longer."""

    def __init__(self, period: float) -> None:
        """Start with ``period`` in s as it was set."""
        self._set = period
        self._seen: deque[float] = deque(maxlen=INTERVALS)
        self._before: tuple[float, int] | None = None
        self.period = period

    def show(self, now: float, stamp: int, step: int) -> None:
        """Take in that a sample came at ``now`` (s) with ``stamp``; samples are ``step`` apart."""
        before, self._before = self._before, (now, stamp)
        if before is None:
            return
        samples = (stamp - before[1] + step // 2) // step
        if samples > 0:
            self._seen.append((now - before[0]) / samples)
        if len(self._seen) >= LEAST_INTERVALS:
            self.period = max(self._set, sorted(self._seen)[len(self._seen) // 2])

    def retune(self, period: float) -> None:
        """Set another period, s; what was seen is forgotten."""
        self._set = self.period = period
        self._seen.clear()
