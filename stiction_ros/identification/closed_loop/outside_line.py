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

from stiction_ros.effects.behaviour import FloatArray

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
    price = np.log(len(rows)) * (1.0 + 2.0 * np.arange(1, harmonics + 1))
    best = (-np.inf, period)
    for shift in np.linspace(-NEAR, NEAR, STEPS):
        frequency = 1.0 / period + shift / count
        if frequency <= 0.0:
            continue
        taken = _taken(waves_of(2 * np.pi * frequency * rows, harmonics), plain, left)[1::2]
        rest = np.maximum(energy - taken, floor)
        gains = len(rows) * np.log(max(energy, floor) / rest) - price[: len(rest)]
        if len(gains):
            best = max(best, (float(gains.max()), 1.0 / frequency))
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


def _taken(lines: FloatArray, plain: FloatArray, left: FloatArray) -> FloatArray:
    """Return the energy that the first k lines take of what a basis leaves, k from 1, (2 H,).

    Args:
        lines: shape (N, 2 H).
        plain: orthonormal basis, shape (N, q).
        left: that it leaves, shape (N,).
    """
    known, seen = plain.T @ lines, lines.T @ left
    gram = lines.T @ lines
    own = np.diag(gram).copy()
    gram -= known.T @ known
    taken = np.zeros(len(seen))
    for k in range(len(seen)):
        if gram[k, k] > DEPENDENT * own[k]:
            by = gram[k, k:] / gram[k, k]
            taken[k] = seen[k] ** 2 / gram[k, k]
            seen[k + 1 :] -= by[1:] * seen[k]
            gram[k + 1 :, k + 1 :] -= np.outer(by[1:], gram[k, k + 1 :])
    return np.cumsum(taken)


def independent(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of a constant and the columns, shape (N, q).

    Directions that are rounding are left out: OP of an exact controller follows from PV.
    """
    about = columns - columns.mean(axis=0)
    scale = np.maximum(np.linalg.norm(about, axis=0), 1e-300)
    left, sizes, _ = np.linalg.svd(about / scale, full_matrices=False)
    constant = np.full((len(columns), 1), 1.0 / np.sqrt(len(columns)))
    return np.concatenate([constant, left[:, sizes > DEPENDENT]], axis=1)
