"""Makes a regular record of samples that are slightly irregular, and says what it did.

A row is a sample with a place, an integer; only places without a row are filled.
"""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.errors import InputError

GAP = 5.5  # a step of more usual steps than this is a gap: the record is split there
HELD = 5  # samples in a row that are held at most

# share of the places that may be without a row, and the mean square by which steps may stray from
# their mean, over that mean: rows missing at random make the one as large as the other
SLIGHT = 0.1
HOLE = 1.5  # a step of more usual steps than this is a hole in which samples are missing
CAUGHT_UP = 0.25  # steps by which rows may still be late when a delay is over: half of the most
SHORTEST = 3  # samples that a repair needs at least
FEWEST_STAMPS = 5  # stamps from which on it can be told that they are cut off
DIFFERENT = 0.5  # share of rows with a stamp of before in which OP or PV must differ
BY_CHANCE = 1e-3  # chance with which rows lost at random may pass for stamps with too few digits
WHOLE = 1e-3  # share of the smallest step by which others may be off its multiples
SILENT = 1e-4  # jitter, as a share of the sample time, that is rounding and not worth a word
TOLERATED = 0.1  # jitter, as a share of the sample time, that is taken as regular with a note


@dataclasses.dataclass(frozen=True)
class Part:
    """One stretch of samples without a gap."""

    first: int  # first, last: rows of the file that it is made of, ``last`` not included
    last: int
    time: FloatArray  # regular times, shape (N,), s; the given ones where nothing was repaired
    place: IntArray  # of each row among the times, increasing, shape (rows,)
    note: str = ""  # what was done; empty for nothing

    @property
    def rows(self) -> IntArray:
        """The row of the file at or before each time, shape (N,)."""
        return self.first + np.searchsorted(self.place, np.arange(len(self.time)), side="right") - 1


def split_at_gaps(time: FloatArray) -> list[tuple[int, int]]:
    """Return first and last (not included) row of each stretch of increasing times without gap."""
    steps = np.diff(time)
    cuts = np.flatnonzero(steps > GAP * float(np.median(steps))) + 1
    edges = [0, *cuts.tolist(), len(time)]
    return list(itertools.pairwise(edges))


def begun_anew(time: FloatArray | IntArray, least: int) -> list[IntArray]:
    """Return the rows of each run where a clock began anew, and all in one where it did not.

    A run of rising times has ``least`` rows, of which as many lie within the times of the next one.
    """
    runs = np.split(np.arange(len(time)), np.flatnonzero(np.diff(time) < 0) + 1)
    long = [run for run in runs if len(run) >= least]
    pairs = itertools.pairwise(sorted((time[run] for run in long), key=lambda run: float(run[0])))
    again = (np.count_nonzero((one >= other[0]) & (one <= other[-1])) for one, other in pairs)
    return long if any(count >= least for count in again) else [np.arange(len(time))]


def regular_part(time: FloatArray, first: int, last: int) -> Part:
    """Return rows ``first`` up to ``last`` of increasing times, (rows,), s, on a regular grid.

    The sample time is the time from the first row to the last over the places between them.
    Rows are taken as they are when their steps differ by a tenth at most, and when more than a
    tenth of the places would be without a row, or steps stray as much as that makes them.
    """
    given = time[first:last]
    plain = Part(first, last, given, np.arange(len(given)))
    if len(given) < SHORTEST:
        return plain
    steps = np.diff(given)
    usual = float(np.median(steps))
    if (np.abs(steps - usual) <= TOLERATED * usual).all():
        return plain
    counts = _of_rounded(given)
    rounded = counts is not None
    if counts is None:
        counts = _of_late(steps)
    place = np.concatenate([[0], np.cumsum(counts)])
    number = int(place[-1]) + 1
    scan = float(given[-1] - given[0]) / (number - 1)
    off = steps / scan - counts
    far = number - len(given)
    if far > SLIGHT * number or (not rounded and np.mean(off[counts == 1] ** 2) > SLIGHT):
        return plain
    worst = float(np.abs(off).max())
    step = shortest(given[0], given[-1], number - 1, min(max(worst, 1e-5), 0.5))
    said = []
    if rounded:
        said.append(f"stamps are rounded, samples are {step:.6g} s apart")
    elif worst > TOLERATED:
        said.append(f"sample times jitter by up to {worst:.0%}, taken as regular, {step:.6g} s")
    return Part(first, last, given[0] + step * np.arange(number), place, "; ".join(said))


def spread_evenly(
    time: FloatArray, first: IntArray, values: Sequence[FloatArray]
) -> tuple[FloatArray, str] | None:
    """Return times of rows whose stamps were cut off, as minutes without their seconds, and a note.

    Then every stamp has as many rows but for one, stamps follow each other evenly, and what stands
    in the rows differs; where a stamp has one row, those with two come evenly. None for rows that
    are there twice. The ``first`` rows are those at which stamps begin; times, s, never fall.
    """
    if len(first) < FEWEST_STAMPS:
        return None
    rows, stamps, counts = np.arange(len(time)), time[first], np.diff(np.append(first, len(time)))
    steps, inner = np.diff(stamps), counts[1:-1]
    usual, step = int(np.median(inner)), float(steps[0])
    even = np.ptp(steps) <= 1e-6 * step and np.ptp(inner) <= 1 and counts.max() <= usual + 1
    again = np.setdiff1d(rows, first)
    differs = np.any([of[again] != of[again - 1] for of in values], axis=0)
    if not even or not differs.mean() > DIFFERENT:
        return None
    said = "stamps lack what is below {:g} s: {} rows on each, spread evenly"
    line = np.polyval(np.polyfit(rows, time - stamps[0], 1), rows) + stamps[0]
    late, scan = line - time, float(line[1] - line[0])
    twice = _evenly(np.flatnonzero(inner > 1))
    fits = bool(np.ptp(inner)) and np.ptp(late) <= step + 0.5 * scan
    if fits and (usual > 1 or (len(twice) > 1 and twice.all())):
        return line - late.min(), said.format(step, f"{step / scan:.3g}")
    if usual < 2:
        return None
    within = rows - np.repeat(first, counts)
    of = np.maximum(np.repeat(counts, counts), usual)
    within[: counts[0]] += max(usual - int(counts[0]), 0)  # the first stamp has its last rows
    return time + step * within / of, said.format(step, usual)


def _evenly(rows: IntArray) -> NDArray[np.bool_]:
    """Return which distances of rows are the usual one, or one row off it, shape (R - 1,)."""
    if len(rows) < 3:
        return np.zeros(max(len(rows) - 1, 0), dtype=np.bool_)
    usual = float(np.median(rows[2:] - rows[:-2])) / 2.0
    return np.asarray(np.abs(np.diff(rows) - usual) <= 1.0)


def _chance_of_even(apart: float) -> float:
    """Return the chance that a distance of rows lost at random is one row off the usual at most."""
    kept = 1.0 - 1.0 / apart
    return float(kept ** max(np.ceil(apart - 1.0) - 1.0, 0.0) - kept ** np.floor(apart + 1.0))


def _of_late(steps: FloatArray) -> IntArray:
    """Return how many places each step takes, shape (rows - 1,): one for all but holes."""
    elapsed = float(steps.sum())
    counts = np.ones(len(steps), dtype=np.int64)
    seen: set[int] = set()
    while (total := int(counts.sum())) not in seen:
        seen.add(total)
        turns = steps / (elapsed / total)
        counts = np.maximum(np.floor(turns + (2.0 - HOLE)), 1.0).astype(np.int64)
        for row in np.flatnonzero(counts > 1).tolist():
            many = int(counts[row])
            around = (turns[max(row - many + 1, 0) : row + 1], turns[row : row + many])
            if any(len(a) == many and a.sum() < many + CAUGHT_UP for a in around):
                counts[row] = 1
    return counts


def _of_rounded(given: FloatArray) -> IntArray | None:
    """Return how many places each step takes where the stamps have too few digits, or None."""
    steps = np.diff(given)
    turns = steps / float(steps.min())
    whole = np.rint(turns)
    long = np.flatnonzero(whole == 2.0)
    even = _evenly(long)
    spoiled = 2.0 * SLIGHT  # a missing row stands within a distance and makes two of it
    if len(even) < 2 or np.mean(even) < 1.0 - spoiled or np.abs(turns - whole).max() > WHOLE:
        return None
    apart = float(np.diff(long)[even].mean())
    if _chance_of_even(apart) ** (np.count_nonzero(even) - 1) > BY_CHANCE:
        return None
    if max(long[0], len(steps) - long[-1]) > 2.0 * apart + 1.0:  # they come in one place only
        return None
    share = 1.0 / apart
    scan = 1.0 + share
    drift = 0.25 * share**2  # from one long step to the next a quarter of what they tell apart
    low, high, behind = -0.5, 0.5, 0.0
    counts = np.ones(len(steps), dtype=np.int64)
    for row, turn in enumerate(whole.tolist()):
        low, high, behind = low - drift, high + drift, behind + turn - scan
        more = max(int(np.ceil((behind - 0.5 - high) / scan - WHOLE)), 0)
        behind -= more * scan
        counts[row] += more
        if behind + 0.5 < low:
            low, high = behind - 0.5, behind + 0.5
        low, high = max(low, behind - 0.5), min(high, behind + 0.5)
    return counts


def sample_time(
    time: FloatArray, where: str, place: Callable[[int], str]
) -> tuple[float, tuple[str, ...]]:
    """Return the seconds between two samples, and one note when the jitter is more than rounding.

    Args:
        time: times of the N samples in s, shape (N,).
        where: file or bag, for errors.
        place: names a sample for errors, ``place(3)`` → ``line 5``.

    Raises:
        InputError: fewer than two samples, time that does not increase, a gap.
    """
    if len(time) < 2:
        raise InputError(
            f"has {len(time)} sample{'s' * (len(time) != 1)}",
            where=where,
            fix="a record needs two at least",
        )
    steps = np.diff(time)
    if not (steps > 0).all():
        row = int(np.argmin(steps > 0)) + 1
        raise InputError(
            f"time does not increase at {place(row)} ({time[row - 1]:.9g}, then {time[row]:.9g} s)",
            where=where,
            fix="sort the rows and remove those that are there twice",
        )
    usual = float(np.median(steps))
    jitter = np.abs(steps - usual) / usual
    worst = int(np.argmax(jitter))
    if jitter[worst] > TOLERATED:
        row = int(np.argmax(jitter > TOLERATED)) + 1
        raise InputError(
            f"time is irregular at {place(row)}: {steps[row - 1]:.6g} s after the sample before, "
            f"elsewhere {usual:.6g} s",
            where=where,
            fix="cut the record there or resample it",
        )
    step = shortest(time[0], time[-1], len(steps), max(float(jitter[worst]), 1e-5))
    if jitter[worst] <= SILENT:
        return step, ()
    note = f"sample times jitter by up to {100 * jitter[worst]:.2g} %, taken as regular"
    return step, (note,)


def shortest(first: float, last: float, steps: int, tolerance: float) -> float:
    """Return the shortest decimal, s, that is the step from one time to another in ``steps``."""
    mean = float(last - first) / steps
    for digits in range(1, 15):
        short = float(f"{mean:.{digits}g}")
        if abs(short - mean) * steps <= tolerance * mean:
            return short
    return mean
