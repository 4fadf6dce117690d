"""How OP has flowed: moves, new values, gaps, the return to normal."""

import itertools
import math
from collections import defaultdict
from collections.abc import Sequence

from stiction_studies.faults.observation import Observation, Sampled

LATE_SAMPLES = 3  # an OP may act that many samples after its own and is new all the same
STEADY = 10  # new OPs in succession after which a loop is said to run
CALM = 1.0  # s without a new OP that are no gap
ORDER = 0.05  # s by which what is sent on two topics may come in another order
LEAD = 1.0  # s before the fault that are looked at as well


def calm(seen: Observation) -> float:
    """Return the time without a new OP that is not yet a gap, s."""
    return max(CALM, STEADY * seen.period)


def largest_move(seen: Observation) -> tuple[float, int]:
    """Return the largest move of an applied OP between two samples, %, and how many were seen.

    A new run of the plant, whose stamps fall back, begins anew; so does what comes after a hole
    in what was heard, over which nothing is known of single samples.
    """
    largest, count = 0.0, 0
    looked = [one for one in seen.applied if one.wall >= seen.begun - LEAD]
    for one, other in itertools.pairwise(looked):
        if 0 <= other.stamp - one.stamp <= seen.step * 3 // 2:
            moves = [abs(b - a) for a, b in zip(one.values, other.values, strict=True)]
            worst = max(moves)
            largest = math.inf if math.isnan(worst) else max(largest, worst)
            count += other.stamp > one.stamp
    return largest, count


def new_ops(seen: Observation) -> list[float]:
    """Return the wall times at which the plant applied an OP that was new.

    New is what the commanding node has sent for this sample or one of the few before, and for
    a later sample than what was applied before.
    """
    sent = _by_stamp(seen.sent)
    found: list[float] = []
    last: int | None = None
    highest: int | None = None
    for one in seen.applied:
        if highest is not None and one.stamp < highest - seen.step:
            last = None  # a new run
        highest = one.stamp
        for late in range(LATE_SAMPLES + 1):
            stamp = one.stamp - late * seen.step
            if last is not None and stamp <= last:
                break
            if any(o.values == one.values and o.wall <= one.wall + ORDER for o in sent[stamp]):
                found.append(one.wall)
                last = stamp
                break
    return found


def longest_without(seen: Observation, fresh: Sequence[float], until: float) -> float:
    """Return the longest time without a new OP from the fault on, s."""
    before = [wall for wall in fresh if wall <= seen.begun]
    inside = [wall for wall in fresh if seen.begun < wall <= until]
    ends = [before[-1] if before else seen.begun, *inside, until]
    return max(later - earlier for earlier, later in itertools.pairwise(ends))


def recovered(seen: Observation, fresh: Sequence[float]) -> float | None:
    """Return how long after the fault OP flows again for good, s; None for never."""
    after = [wall for wall in fresh if wall >= seen.over]
    allowed = calm(seen)
    start = 0
    for index in range(1, len(after)):
        if after[index] - after[index - 1] > allowed:
            start = index
    steady = after[start:]
    if len(steady) < STEADY or seen.until - steady[-1] > allowed:
        return None
    first = steady[0] - seen.over
    return 0.0 if start == 0 and first <= allowed else first


def _by_stamp(sent: Sequence[Sampled]) -> defaultdict[int, list[Sampled]]:
    found: defaultdict[int, list[Sampled]] = defaultdict(list)
    for one in sent:
        found[one.stamp].append(one)
    return found
