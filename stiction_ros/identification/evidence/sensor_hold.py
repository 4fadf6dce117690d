"""A sensor that holds its last value is a rival of friction: rows that it repeats tell nothing.

Where PV stays exactly as it was and then jumps, the transmitter, a wireless link or the historian
did not refresh it. A stem that rests looks the same. So such rows are replaced by their conditional
mean under the ideal valve and autoregressive noise, both fitted to lines between what was measured:
the ideal valve then explains them, and friction can gain only by rows that were measured.
"""

import dataclasses
import math

import numpy as np
from scipy.linalg import solveh_banded

from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.identification.evidence.candidate import ideal
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.records.record import Record
from stiction_ros.signals.autoregression import LOAD

ROUNDED = 2.0
"""Steps of rounding by which a rounded value may change after it has repeated: one when it crosses
a border of rounding slowly, two when noise carries it over the next."""


def held_rows(pv: FloatArray) -> BoolArray:
    """Return which rows repeat a value because PV was not read, shape (N,).

    Where PV never returns to a value, PV is not rounded, and all repeats are held, as by a sensor
    that reports by exception. Where PV is rounded, a run of repeats is held in two cases: the run
    ends in a jump that rounding cannot make, or noise leaves a value as it is for so long less than
    once in a record. The step of rounding is the least difference of any two values.

    Args:
        pv: one output, shape (N,).
    """
    moves = np.abs(np.diff(pv))
    still = moves <= 1e-9 * max(float(np.ptp(pv)), 1e-300)
    if still.all():
        return np.ones(len(pv), dtype=bool)
    values = np.unique(pv)
    if len(values) > int((~still).sum()):
        return np.append(False, still)
    step = float(np.diff(values).min())
    ends = np.append(np.flatnonzero(~still), len(moves))  # moves that end a run of repeats
    held = np.append(moves[ends[:-1]] > ROUNDED * step * (1.0 + 1e-6), False)
    repeats = np.diff(ends, prepend=-1) - 1
    held |= len(pv) * _stays(pv, step) ** repeats < 1.0
    run = np.searchsorted(ends, np.arange(len(moves)))
    return np.concatenate([[False], still & held[run]])


def _stays(pv: FloatArray, step: float) -> float:
    """Return how likely white noise leaves a rounded value as it is, where that is likeliest.

    The variance of the noise is the negative covariance of successive changes (Roll 1984,
    J. Finance 39, 1127), less the variance of rounding. A trend raises that covariance: the
    covariance of changes two samples apart, which noise leaves at 0, is taken off.

    Args:
        pv: shape (N,).
        step: of rounding.
    """
    changes = np.diff(pv)
    trend = max(float(changes[2:] @ changes[:-2]), 0.0)
    variance = (trend - float(changes[1:] @ changes[:-1])) / len(changes) - step**2 / 12.0
    return math.erf(step / math.sqrt(8.0 * variance)) if variance > 0.0 else 1.0


def refresh(record: Record) -> tuple[int, int]:
    """Return the samples from one refresh of PV to the next, and the first that was refreshed.

    (1, 0) where PV is not refreshed at regular times.

    Args:
        record: without gaps.
    """
    fresh = np.flatnonzero((np.diff(record.pv, axis=0) != 0.0).any(axis=1)) + 1
    every = np.diff(fresh)
    if len(every) < 2:
        return 1, 0
    step = int(np.gcd.reduce(every))
    return (step, int(fresh[0]) % step) if step > 1 else (1, 0)


def hold_notes(record: Record) -> tuple[str, ...]:
    """Return a sentence on each output whose sensor holds, or is refreshed at regular times.

    Args:
        record: without gaps.
    """
    step, _ = refresh(record)
    if step > 1:
        return (f"PV is refreshed every {step} samples only",)
    shares = (100.0 * float(held_rows(column).mean()) for column in record.pv.T)
    return tuple(
        f"measurement {tag} was stale for {share:.0f} % of the samples; these count as not measured"
        for tag, share in zip(record.outputs, shares, strict=True)
        if round(share) > 0
    )


def restored(record: Record, options: IdentificationOptions) -> Record:
    """Return a record whose held rows of PV are their conditional mean under ideal valves.

    Where PV is refreshed at regular times it is left as it is: rows of that length hold one value.

    Args:
        record: without gaps.
        options: of the fit.
    """
    held = np.array([held_rows(column) for column in record.pv.T])
    held[held.all(axis=1)] = False
    if refresh(record)[0] > 1 or not held.any():
        return record
    pv, rows = record.pv.copy(), np.arange(len(record))
    for i, holds in enumerate(held):
        pv[:, i] = np.interp(rows, rows[~holds], record.pv[~holds, i])
    problem = Problem.of(dataclasses.replace(record, pv=pv), options)
    mean, scale = pv.mean(axis=0), pv.std(axis=0)
    for i, (fit, holds) in enumerate(zip(ideal(problem).fits, held, strict=True)):
        free_run = problem.pv[i] - fit.rest
        rest = (record.pv[:, i] - mean[i]) / scale[i] - free_run
        between = free_run[holds] + _mean_of(rest, holds, fit.noise)
        pv[holds, i] = mean[i] + scale[i] * between
    return dataclasses.replace(record, pv=pv)


def _mean_of(rest: FloatArray, held: BoolArray, noise: FloatArray) -> FloatArray:
    """Return the conditional mean of held rows of noise D(q) w = e, given the others, (H,)."""
    order, rows = len(noise) - 1, np.flatnonzero(held)
    shared = np.correlate(noise, noise, "full")
    known = np.convolve(np.where(held, 0.0, rest), shared, "same")[rows]
    bands = np.zeros((order + 1, len(rows)))
    for lag in range(min(order + 1, len(rows))):
        apart = rows[lag:] - rows[: len(rows) - lag]
        bands[order - lag, lag:] = np.where(
            apart <= order, shared[np.minimum(order + apart, 2 * order)], 0.0
        )
    bands[order] += LOAD * shared[order]
    return np.asarray(solveh_banded(bands, -known))
