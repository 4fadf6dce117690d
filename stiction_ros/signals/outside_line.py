r"""A line from outside: does a clock that is not the loop's explain what the loop leaves open?

An output is predicted one step ahead from its own past and from its input,

.. math:: y_k = c + \sum_{i=1}^{n} a_i y_{k-i} + \sum_{i=0}^{n-1} b_i x_{k-d-i} + \ell_k, \quad
          \ell_k = \sum_{h=1}^{H} (s_h \sin h \omega k + c_h \cos h \omega k)

once without and once with the line ℓ, a wave of any shape and of exactly one period. The gain in
BIC says whether the line is there. From PV behind a valve that sticks it is not: the stem explains
the cycle, and noise shifts each slip, so that no clock keeps up with it. A load that swings from
outside keeps its time. The same from OP, with the error as input: a line there comes from a
set-point that is not in the record, or from another controller.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray

ORDER = 5
"""n, samples of the past: enough to leave white noise of what loops are sampled at."""

HARMONICS = 5
"""H at most: the first three that a square or a triangle wave has; the best number is taken."""

LEAST_PER_HARMONIC = 2.5
"""Samples that the fastest harmonic has per period at least."""

NEAR = 1.0
"""Line widths 1/N by which the period may differ from the one given, to either side."""

STEPS = 17
"""Periods tried over this range: one eighth of a line width apart."""

BESIDE = 3
"""Order of the process that is fitted beside a line."""

DEPENDENT = 1e-7
"""Size of a direction, of scaled columns, below which it is rounding."""

LEAST_ROWS = 40
"""Rows that a fit needs."""


@dataclasses.dataclass(frozen=True)
class OutsideLine:
    """What a line at a cycle's period adds.

    Attributes:
        gain: BIC without minus BIC with the line; above 0 the line is there.
        period: the best one, samples.
        plain: BIC without.
    """

    gain: float
    period: float
    plain: float


NO_LINE = OutsideLine(0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Predicted:
    """A signal and what it is predicted from.

    Attributes:
        y: shape (N,).
        inputs: shape (N,) each.
        delays: samples before the first of each input counts, 0 for the same sample.
    """

    y: FloatArray
    inputs: Sequence[FloatArray]
    delays: Sequence[int]


def outside_line(signal: Predicted, period: float) -> OutsideLine:
    """Return the gain by a line at about ``period`` samples."""
    count, first = len(signal.y), ORDER + max(signal.delays)
    harmonics = min(HARMONICS, int(period / LEAST_PER_HARMONIC))
    rows = np.arange(first, count)
    if len(rows) < LEAST_ROWS + (1 + len(signal.inputs)) * ORDER or harmonics < 1:
        return NO_LINE
    columns = [signal.y[rows - lag] for lag in range(1, ORDER + 1)]
    for x, delay in zip(signal.inputs, signal.delays, strict=True):
        columns += [x[rows - delay - lag] for lag in range(ORDER)]
    plain = independent(np.column_stack(columns))
    wanted = signal.y[rows] - signal.y[rows].mean()  # far from zero, rounding would eat it
    left = wanted - plain @ (plain.T @ wanted)
    energy = float(left @ left)
    floor = 1e-12 * float(wanted @ wanted)  # what rounding leaves
    frequencies = 1.0 / period + np.linspace(-NEAR, NEAR, STEPS) / count
    frequencies = frequencies[frequencies > 0.0]
    taken = _taken(2.0 * np.pi * frequencies, rows, harmonics, plain, left)
    rest = np.maximum(energy - taken, floor)
    price = np.log(len(rows)) * (1.0 + 2.0 * np.arange(1, harmonics + 1))
    gains = (len(rows) * np.log(max(energy, floor) / rest) - price).max(axis=1)
    best = max(zip(gains.tolist(), (1.0 / frequencies).tolist(), strict=True))
    count, columns_used = plain.shape
    before = count * np.log(max(energy, floor) / count) + columns_used * np.log(count)
    return OutsideLine(*best, float(before))


def beside(signal: Predicted, period: float) -> tuple[FloatArray, FloatArray]:
    """Return the process that moves ``signal`` beside a wave of ``period`` samples.

    A wave from outside makes any process that is fitted to it ring at its period, as OP answers
    PV; with the wave in the equation the process is what the other movements say.

    Returns:
        a_1 … a_3 and b_0 … b_2 of each input after its delay, signs as in equation (8a), shape
        (3,) and (inputs, 3).
    """
    rows = np.arange(BESIDE + max(signal.delays), len(signal.y))
    harmonics = max(1, min(HARMONICS, int(period / LEAST_PER_HARMONIC)))
    columns = [signal.y[rows - lag] for lag in range(1, BESIDE + 1)]
    for x, delay in zip(signal.inputs, signal.delays, strict=True):
        columns += [x[rows - delay - lag] for lag in range(BESIDE)]
    columns.append(np.ones(len(rows)))
    wave = waves_of(np.asarray(2 * np.pi / period * rows, dtype=np.float64), harmonics)
    table = np.column_stack([*columns, wave])
    scale = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    theta = np.linalg.lstsq(table / scale, signal.y[rows], rcond=1e-10)[0] / scale
    return -theta[:BESIDE], theta[BESIDE : BESIDE * (1 + len(signal.inputs))].reshape(-1, BESIDE)


def waves_of(angle: FloatArray, harmonics: int) -> FloatArray:
    """Return sine and cosine of one harmonic after the other, shape (N, 2 H)."""
    turns = np.cumprod(np.tile(np.exp(1j * angle), (harmonics, 1)), axis=0)
    return np.stack([turns.imag, turns.real], axis=1).reshape(-1, len(angle)).T


def _taken(
    turns: FloatArray, rows: IntArray, harmonics: int, plain: FloatArray, left: FloatArray
) -> FloatArray:
    """Return the energy that the first h harmonics take of what a basis leaves, shape (F, H).

    Args:
        turns: radians per sample, rising in even steps, shape (F,).
        rows: consecutive, shape (N,).
        harmonics: H.
        plain: orthonormal basis, shape (N, q).
        left: that it leaves, shape (N,).
    """
    by_harmonic = np.empty((len(turns), harmonics, 2, len(rows)))
    wave = np.exp(1j * turns[0] * rows)
    step = np.exp(1j * (turns[1] - turns[0]) * rows)
    for own in by_harmonic:
        power = wave
        for h in range(harmonics):
            own[h] = power.imag, power.real
            power = power * wave
        wave = wave * step
    lines = by_harmonic.reshape(len(turns), 2 * harmonics, len(rows))
    known, seen = lines @ plain, lines @ left
    own = _products(turns, rows, harmonics)
    gram = own - known @ known.transpose(0, 2, 1)
    taken = np.zeros_like(seen)
    for k in range(seen.shape[1]):
        pivot = gram[:, k, k]
        there = pivot > DEPENDENT * own[:, k, k]
        over = np.where(there, 1.0, 0.0) / np.where(there, pivot, 1.0)
        taken[:, k] = over * seen[:, k] ** 2
        by = over[:, None] * gram[:, k]
        seen -= by * seen[:, k : k + 1]
        gram -= by[:, :, None] * gram[:, k, None, :]
    return np.asarray(np.cumsum(taken, axis=1)[:, 1::2])


def _products(turns: FloatArray, rows: IntArray, harmonics: int) -> FloatArray:
    """Return the inner products of sines and cosines of the harmonics, shape (F, 2 H, 2 H).

    Of two waves it is half the sums of that of their difference and that of their sum, which are
    geometric.
    """
    h = np.arange(1, harmonics + 1)
    sums = np.full((len(turns), 2 * harmonics + 1), len(rows), dtype=complex)
    each = np.exp(1j * np.outer(turns, np.arange(1, 2 * harmonics + 1)))
    sums[:, 1:] = each ** rows[0] * (1.0 - each ** len(rows)) / (1.0 - each)
    both = sums[:, h[:, None] + h]
    apart = sums[:, np.abs(h[:, None] - h)]
    apart = np.where(h[:, None] >= h, apart, apart.conj())
    found = np.empty((len(turns), harmonics, 2, harmonics, 2))
    found[:, :, 0, :, 0] = (apart - both).real
    found[:, :, 1, :, 1] = (apart + both).real
    found[:, :, 0, :, 1] = (both + apart).imag
    found[:, :, 1, :, 0] = (both - apart).imag
    return 0.5 * found.reshape(len(turns), 2 * harmonics, 2 * harmonics)


def independent(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of a constant and the columns, shape (N, q).

    Directions that are rounding are left out: OP of an exact controller follows from PV.
    """
    about = columns - columns.mean(axis=0)
    scale = np.maximum(np.linalg.norm(about, axis=0), 1e-300)
    left, sizes, _ = np.linalg.svd(about / scale, full_matrices=False)
    constant = np.full((len(columns), 1), 1.0 / np.sqrt(len(columns)))
    return np.concatenate([constant, left[:, sizes > DEPENDENT]], axis=1)
