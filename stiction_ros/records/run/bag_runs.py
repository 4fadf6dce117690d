"""Tells the runs in a bag apart: a plant that was restarted begins its stamps anew.

Stamps are followed as *chains*: messages of both runs may stand in any order. A chain that begins
behind the end of another goes on with it after a gap; one whose stamps fall back is another run.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.records.regular import GAP

NEW_RUN = 10  # messages that make a run beside another; fewer are out of order
LATE = 3  # messages out of order that may have come late, and are put where they are missing
AGAIN = 0.75  # how far off, in usual steps, a message counts that shows the present sample again
STALE = 0.1  # how much further off a chain counts for each message that did not continue it
FORGOTTEN = 25  # messages after which a chain that none of them continued is over
NEAR = 30  # messages of all signals between a sample and another signal's message for it, at most


@dataclasses.dataclass
class Run:
    """Messages of one run."""

    place: dict[int, int]  # stamp in ns to number in the log of the first message of that stamp
    begin: int  # begin, end: numbers of its first and last message in the log
    end: int
    first: int  # first, last: smallest and largest stamp, ns
    last: int

    @classmethod
    def of(cls, stamp: int, number: int) -> "Run":
        """Begin with one message."""
        return cls({stamp: number}, number, number, stamp, stamp)

    def take(self, stamp: int, number: int) -> None:
        """Add a message whose stamp is not older than the last."""
        self.place.setdefault(stamp, number)
        self.end, self.last = number, stamp

    def append(self, other: "Run") -> None:
        """Go on with another run behind the end of this one."""
        self.place.update(other.place)
        self.end, self.last = other.end, other.last


@dataclasses.dataclass(frozen=True)
class Told:
    """What the stamps of a signal tell."""

    runs: tuple[Run, ...]  # in the order in which they begin
    strays: tuple[Run, ...]  # stretches too short for a run, in the same order
    lost: int  # messages in no run


def tell_runs(stamps: Sequence[int], numbers: Sequence[int]) -> Told:
    """Tell apart the runs of one signal by its stamps, ns, and numbers in the order of the log."""
    pieces = _connected(_chains(stamps, numbers))
    if not pieces:
        return Told((), (), 0)
    longest = max(pieces, key=lambda run: len(run.place))
    runs: list[Run] = []
    strays: list[Run] = []
    late: list[Run] = []
    for run in pieces:
        if run is longest or len(run.place) >= NEW_RUN:
            runs.append(run)
        else:
            (late if len(run.place) <= LATE else strays).append(run)
    lost = sum(len(run.place) for run in strays)
    for run in late:
        lost += sum(not _inserted(runs, *message) for message in run.place.items())
    return Told(tuple(runs), tuple(strays), lost)


def run_of(runs: Sequence[Run], stamp: int, number: int) -> Run:
    """Return which of ``runs``, one at least, a message of another signal belongs to.

    It is the one that has its stamp, in ns, nearest to its number in the log, unless that is far
    away, as when the sample itself was lost: then it is the run that had begun last.
    """
    active = next((run for run in reversed(runs) if run.begin <= number), runs[0])
    known = [run for run in runs if stamp in run.place]
    if not known:
        return active
    nearest = min(known, key=lambda run: abs(run.place[stamp] - number))
    near = abs(nearest.place[stamp] - number) <= NEAR
    return nearest if near or stamp in active.place else active


def _chains(stamps: Sequence[int], numbers: Sequence[int]) -> list[Run]:
    """Follow the stamps; return the chains in the order in which they begin."""
    step = _usual_step(stamps)
    chains: list[Run] = []
    alive: list[tuple[int, Run]] = []  # when it was continued last, newest at the end
    for k, (stamp, number) in enumerate(zip(stamps, numbers, strict=True)):
        alive = [entry for entry in alive if k - entry[0] <= FORGOTTEN]
        best, best_off = -1, float("inf")
        for place in range(len(alive) - 1, -1, -1):
            ahead = stamp - alive[place][1].last
            if not ahead and place < len(alive) - 1:
                continue  # a sample is shown again at once
            off = abs(ahead - step) if ahead else AGAIN * step
            off += STALE * step * (k - alive[place][0])
            if 0 <= ahead <= GAP * step and off < best_off:
                best, best_off = place, off
        if best < 0:
            chain = Run.of(stamp, number)
            chains.append(chain)
        else:
            _, chain = alive.pop(best)
            chain.take(stamp, number)
        alive.append((k, chain))
    return chains


def _usual_step(stamps: Sequence[int]) -> float:
    """Return the usual step from one message of a run to the next, ns."""
    found = []
    for lag in (1, 2):
        given = np.asarray(stamps, dtype=np.int64)
        steps = given[lag:] - given[:-lag]
        steps = steps[steps > 0]
        if len(steps):
            found.append(float(np.median(steps)))
    return min(found, default=1.0)


def _connected(chains: Sequence[Run]) -> list[Run]:
    """Join chains of which one begins where another has ended, in stamps and in the log."""
    runs: list[Run] = []
    for chain in chains:
        newest = max((run.begin for run in runs if len(run.place) >= NEW_RUN), default=0)
        before = [run for run in runs if run.last < chain.first and newest <= run.end < chain.begin]
        if before:
            max(before, key=lambda run: run.end).append(chain)
        else:
            runs.append(chain)
    return runs


def _inserted(runs: Sequence[Run], stamp: int, number: int) -> bool:
    """Put a message that came out of order where it is missing; tell whether it was."""
    near = [
        run
        for run in runs
        if stamp not in run.place
        and run.first < stamp < run.last
        and run.begin <= number <= run.end + NEAR
    ]
    if len(near) != 1:
        return False
    near[0].place[stamp] = number
    return True
