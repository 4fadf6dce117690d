r"""The set-point that a record lacks, where the law of its controller tells it.

.. math:: s_k = u_k - u_{k-1} + K (y_k - y_{k-1}) + I \sum y = K (r_k - r_{k-1}) + I \sum r

rests where the set-point r does, and jumps where it does. The sums are over the scans of a sample.
"""

import dataclasses
import math

import numpy as np
from scipy.linalg import solveh_banded

from stiction_ros.discrepancy.data.scans import between_samples
from stiction_ros.discrepancy.measures import (
    MAJORITY,
    NEARLY_ALL,
    NORMAL_OF_MEDIAN,
    ROUNDING,
    SURPRISE,
)
from stiction_ros.discrepancy.simulation.free_run import FEWEST, Runs
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.loop import LoopModel, PiTuning
from stiction_ros.signals.holds import stretches


@dataclasses.dataclass(frozen=True)
class Told:
    """Records with set-points that a law tells."""

    runs: Runs  # the records
    tuning: PiTuning  # of the controller
    error: float  # standard error of a set-point, units of PV
    rest: float  # samples between two moves of it, in the mean


def told_set_points(model: LoopModel, runs: Runs, scans: int) -> Told | None:
    """Return the records with the set-points by which a PI law gives OP.

    Args:
        model: of a loop with one valve and one output.
        runs: records of it.
        scans: of the controller in a sample, 1 or 2; PV between two samples is taken to lie on a
            cubic through the four about them, which leaves the mean of s where it is.

    Returns:
        None where no law does, or its set-point hardly ever rests.
    """
    parts = [_Part.of(runs, rows, scans, model.limits[0]) for rows in runs.slices]
    law = _law(parts, model.controller, runs.sample_time / scans)
    if law is None:
        return None
    records, levels = [], 0
    for record, part in zip(runs.records, parts, strict=True):
        own = part.set_point(*law)
        if own is None:
            return None
        sp = np.full(record.pv.shape, np.nan)
        sp[:, record.outputs.index(model.outputs[0])] = own
        records.append(dataclasses.replace(record, sp=sp))
        levels += len(np.unique(own))
    rest = max(len(runs) / levels, 2.0)
    gain, integral, usual = law
    tuning = PiTuning(gain, gain * runs.sample_time / (scans * integral))
    error = usual / (scans * abs(integral) * math.sqrt(rest))
    return Told(dataclasses.replace(runs, records=tuple(records)), tuning, error, rest)


@dataclasses.dataclass(frozen=True)
class _Part:
    """One record."""

    scans: int  # of the controller in a sample
    moves: FloatArray  # u_k − u_{k−1}, shape (N,), the first 0
    columns: FloatArray  # y_k − y_{k−1} and the sum of y over the scans since k − 1, shape (N, 2)
    free: BoolArray  # where OP and the two before it are between the limits, shape (N,)

    @classmethod
    def of(cls, runs: Runs, rows: slice, scans: int, limits: FloatArray) -> "_Part":
        """Return the rows of one record."""
        op, pv = runs.op[rows, 0], runs.pv[rows, 0]
        free = (op > limits[0]) & (op < limits[1])
        free[2:] &= free[1:-1] & free[:-2]
        free[:2] = False
        seen = pv.copy()
        if scans == 2:
            seen[1:] += between_samples(pv)
        columns = np.column_stack([np.diff(pv, prepend=pv[0]), seen])
        return cls(scans, np.diff(op, prepend=op[0]), columns, free)

    def set_point(self, gain: float, integral: float, usual: float) -> FloatArray | None:
        """Return SP, shape (N,); None where it moves too often."""
        told = self.moves + self.columns @ np.array([gain, integral])
        moved = self.free & (np.abs(np.diff(told, prepend=told[0])) > SURPRISE * usual)
        begins, _ = stretches(moved)
        rests = self.free & ~moved
        if len(begins) > (1.0 - NEARLY_ALL) * len(told) or not rests.any():
            return None
        edges = np.concatenate([[0], begins, [len(told)]])
        counts = np.add.reduceat(rests, edges[:-1]).astype(float)
        means = np.add.reduceat(np.where(rests, told, 0.0), edges[:-1]) / np.maximum(counts, 1.0)
        levels = self._levels(told[begins], means, counts, gain, integral)
        return np.repeat(levels, np.diff(edges))

    def _levels(
        self, jumps: FloatArray, means: FloatArray, counts: FloatArray, gain: float, integral: float
    ) -> FloatArray:
        """Return SP between its moves, by least squares of its rests and of its jumps.

        With two scans in a sample SP may move at either; the one that is nearer is taken. Where a
        mean is of no samples, the jumps alone tell.
        """
        whole = self.scans * integral
        first = means / whole
        if not len(jumps):
            return first
        late = integral * np.arange(self.scans)[:, None]  # what of the sums is still the old one's
        old, new = late - gain, whole + gain - late
        left = np.abs(jumps - new * first[1:] - old * first[:-1])
        nearer = left.argmin(axis=0)
        old, new = old[nearer, 0], new[nearer, 0]
        bands, wanted = np.zeros((2, len(means))), whole * counts * means
        bands[1] = whole**2 * counts
        bands[1, 1:] += new**2
        bands[1, :-1] += old**2
        bands[0, 1:] = old * new
        wanted[1:] += new * jumps
        wanted[:-1] += old * jumps
        return np.asarray(solveh_banded(bands, wanted))


def _of_least_sizes(columns: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the factors of columns, shape (2,), that leave the least sum of sizes, by HiGHS."""
    from scipy.optimize import linprog
    from scipy.sparse import eye, hstack

    count, factors = columns.shape
    each = eye(count)
    found = linprog(
        np.concatenate([np.zeros(factors), np.ones(2 * count)]),
        A_eq=hstack([columns, each, -each]),
        b_eq=wanted,
        bounds=[*[(None, None)] * factors, *[(0.0, None)] * (2 * count)],
    )
    return np.asarray(found.x[:factors])


def _law(
    parts: list[_Part], tuning: PiTuning | None, interval: float
) -> tuple[float, float, float] | None:
    """Return K, I and the usual size of what they leave of the changes of s; None without a law.

    Where no tuning is given the sum of sizes is least: jumps of SP are few and large. The interval
    is that between two scans, s.
    """
    wanted = np.concatenate([np.diff(p.moves, prepend=0.0)[p.free] for p in parts])
    columns = np.vstack([-np.diff(p.columns, axis=0, prepend=p.columns[:1])[p.free] for p in parts])
    if len(wanted) < FEWEST or np.mean(wanted != 0.0) < MAJORITY:
        return None  # where OP rests more often, somebody moves it
    nothing = ROUNDING * float(np.abs(wanted).max())
    if tuning is None:
        law = _of_least_sizes(columns, wanted)
    else:
        law = tuning.gain * np.array([1.0, interval / tuning.integral_time])
    gain, integral = law.tolist()
    usual = float(np.median(np.abs(wanted - columns @ law)))
    left_over = usual > MAJORITY * float(np.median(np.abs(wanted)))
    if integral == 0.0 or gain / integral <= 0.0 or left_over:
        return None
    return gain, integral, max(NORMAL_OF_MEDIAN * usual, nothing)
