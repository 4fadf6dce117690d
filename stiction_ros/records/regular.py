"""Makes a regular record of samples that are slightly irregular, and says what it did."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.quality import Quality, QualityArray
from stiction_ros.records.sampling import TOLERATED

GAP = 5.5
"""A step of more usual steps than this is a gap: the record is split there."""

SLIGHT = 0.1
"""Share of the samples that a repair may make up for; more is irregular."""

WIDEST = 200
"""Frequencies looked at on either side of the usual one."""

HOLE = 1.5
"""A step of more usual steps than this is a hole in which samples are missing."""

EXACT = 1e-6
"""Share of a step by which a row may be off a regular time and is taken as it is."""

SHORTEST = 3
"""Samples that a repair needs at least."""


@dataclasses.dataclass(frozen=True)
class Part:
    """One stretch of samples without a gap.

    Attributes:
        first, last: rows of the file that it is made of, ``last`` not included.
        time: regular times, shape (N,), s; the given ones where nothing was repaired.
        left: for each time the row, counted from ``first``, given at or before it, shape (N,).
        weight: share of the next row in a linear interpolation, in [0, 1), shape (N,).
        missing: whether no row is within half a step of a time, shape (N,).
        note: what was done; empty for nothing.
    """

    first: int
    last: int
    time: FloatArray
    left: np.ndarray[tuple[int], np.dtype[np.intp]]
    weight: FloatArray
    missing: np.ndarray[tuple[int], np.dtype[np.bool_]]
    note: str = ""

    def interpolated(self, values: FloatArray) -> FloatArray:
        """Return measured values, shape (rows, …), at the regular times, shape (N, …)."""
        rows = values[self.first : self.last]
        before, after = rows[self.left], rows[np.minimum(self.left + 1, len(rows) - 1)]
        weight = self.weight.reshape(-1, *[1] * (values.ndim - 1))
        return np.where(weight > 0, before + weight * (after - before), before)

    def held(self, values: FloatArray) -> FloatArray:
        """Return values that are held between two rows, such as OP and SP, shape (N, …)."""
        return np.asarray(values[self.first : self.last][self.left])

    def quality(self, mask: QualityArray | None) -> QualityArray | None:
        """Return the mask at the regular times, of all rows' ``mask``, None when all are good."""
        if mask is None and not self.missing.any():
            return None
        count = len(self.time)
        if mask is None:
            found = np.zeros(count, dtype=np.uint8)
        else:
            rows = mask[self.first : self.last]
            after = rows[np.minimum(self.left + 1, len(rows) - 1)]
            found = rows[self.left].copy()
            found[(self.weight > 0) & (after == Quality.BAD)] = Quality.BAD
        found[self.missing & (found == Quality.GOOD)] = Quality.HELD
        return found


def split_at_gaps(time: FloatArray, longest: float = GAP) -> list[tuple[int, int]]:
    """Return first and last (not included) row of each stretch without a gap.

    Args:
        time: increasing times, shape (N,), s.
        longest: step, in usual ones, above which there is a gap.
    """
    steps = np.diff(time)
    cuts = np.flatnonzero(steps > longest * float(np.median(steps))) + 1
    edges = [0, *cuts.tolist(), len(time)]
    return list(itertools.pairwise(edges))


def regular_part(time: FloatArray, first: int, last: int) -> Part:
    """Return rows ``first`` up to ``last`` on a regular grid.

    Rows that keep to the grid within a tenth of a step are taken as they are. Otherwise, when
    at least nine tenths of the grid's times have a row within half a step, the values are
    brought onto the grid: measured ones by linear interpolation, OP and SP by holding.

    Args:
        time: increasing times of all rows, shape (rows,), s.
        first, last: the stretch, without a gap inside.
    """
    given = time[first:last]
    count = len(given)
    plain = Part(
        first, last, given, np.arange(count), np.zeros(count), np.zeros(count, dtype=np.bool_)
    )
    if len(given) < SHORTEST:
        return plain
    steps = np.diff(given)
    usual = float(np.median(steps))
    if (np.abs(steps - usual) <= TOLERATED * usual).all():
        return plain
    grid = _grid(given, usual)
    number, step = len(grid), float(grid[1] - grid[0])
    nearest = np.abs(grid[:, None] - given[_neighbours(given, grid)]).min(axis=1)
    moved = int(np.count_nonzero(nearest > TOLERATED * step))
    missing = nearest > 0.5 * step
    far = int(np.count_nonzero(missing))
    spare = max(len(given) - number, 0)
    if far + spare > SLIGHT * number:
        return plain
    left = np.clip(np.searchsorted(given, grid + 1e-9 * step, side="right") - 1, 0, len(given) - 1)
    span = np.diff(given, append=given[-1] + step)[left]
    weight = np.clip((grid - given[left]) / span, 0.0, 1.0)
    weight[(left == len(given) - 1) | (weight < EXACT)] = 0.0
    note = (
        f"resampled to one sample each {step:.6g} s: {moved} of {number} were off by more than "
        f"{TOLERATED:.0%} of a step, {far} of them missing; pv and stem are interpolated, op and "
        "sp held"
    )
    return Part(first, last, grid, left, weight, missing, note)


def _grid(given: FloatArray, usual: float) -> FloatArray:
    """Return the regular times that fit ``given`` best, shape (N,), two at least.

    The frequency is the one near 1 / ``usual`` at which the times are most in step; offset and
    step then follow by least squares.
    """
    elapsed = given - given[0]
    middle = int(np.rint(elapsed[-1] / usual))
    reach = min(2 + middle // 20, WIDEST)
    best, phase = 0.0, 0.0
    cycles = middle
    for candidate in range(max(middle - reach, 1), middle + reach + 1):
        turns = np.exp(2j * np.pi * candidate * elapsed / elapsed[-1]).mean()
        if abs(turns) > best:
            best, phase, cycles = abs(turns), float(np.angle(turns)) / (2 * np.pi), candidate
    place = np.rint(elapsed * cycles / elapsed[-1] - phase)
    place -= place[0]
    centred = place - place.mean()
    step = float(centred @ elapsed / (centred @ centred))
    begin = float(elapsed.mean() - step * place.mean())
    return np.asarray(given[0] + begin + step * np.arange(max(int(place[-1]) + 1, 2)))


def _neighbours(
    given: FloatArray, grid: FloatArray
) -> np.ndarray[tuple[int, int], np.dtype[np.intp]]:
    """Return for each time of the grid the rows before and after it, shape (N, 2)."""
    after = np.searchsorted(given, grid)
    return np.stack(
        [np.clip(after - 1, 0, len(given) - 1), np.clip(after, 0, len(given) - 1)], axis=1
    )
