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

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.arx import arx_columns
from stiction_ros.signals.spectral_lines import (
    DEPENDENT,
    LEAST_PER_HARMONIC,
    taken_by_waves,
    waves_of,
)

ORDER = 5  # n, samples of the past: enough to leave white noise of what loops are sampled at
# H at most: the first three that a square or a triangle wave has; the best number is taken
HARMONICS = 5
NEAR = 1.0  # line widths 1/N by which the period may differ from the one given, to either side
STEPS = 17  # periods tried over this range: one eighth of a line width apart
BESIDE = 3  # order of the process that is fitted beside a line
LEAST_ROWS = 40  # rows that a fit needs


@dataclasses.dataclass(frozen=True)
class OutsideLine:
    """What a line at a cycle's period adds."""

    gain: float  # BIC without minus BIC with the line; above 0 the line is there
    period: float  # the best one, samples
    plain: float  # BIC without


NO_LINE = OutsideLine(0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Predicted:
    """A signal and what it is predicted from."""

    y: FloatArray  # shape (N,)
    inputs: Sequence[FloatArray]  # shape (N,) each
    delays: Sequence[int]  # samples before the first of each input counts, 0 for the same sample

    def columns(self, order: int, first: int) -> list[FloatArray]:
        """Return ``order`` samples of each signal for every row from ``first`` on."""
        delays = [delay - 1 for delay in self.delays]
        return arx_columns(self.y, self.inputs, delays, (order, order), first)


def outside_line(signal: Predicted, period: float) -> OutsideLine:
    """Return the gain by a line at about ``period`` samples."""
    count, first = len(signal.y), ORDER + max(signal.delays)
    harmonics = min(HARMONICS, int(period / LEAST_PER_HARMONIC))
    rows = np.arange(first, count)
    if len(rows) < LEAST_ROWS + (1 + len(signal.inputs)) * ORDER or harmonics < 1:
        return NO_LINE
    plain = independent(np.column_stack(signal.columns(ORDER, first)))
    wanted = signal.y[first:] - signal.y[first:].mean()  # far from zero, rounding would eat it
    left = wanted - plain @ (plain.T @ wanted)
    energy = float(left @ left)
    floor = 1e-12 * float(wanted @ wanted)  # what rounding leaves
    frequencies = 1.0 / period + np.linspace(-NEAR, NEAR, STEPS) / count
    frequencies = frequencies[frequencies > 0.0]
    turns = (np.asarray(2.0 * np.pi * one * rows, dtype=np.float64) for one in frequencies)
    each = np.array([taken_by_waves(angle, harmonics, plain, left) for angle in turns])
    rest = np.maximum(energy - np.cumsum(each, axis=1)[:, 1::2], floor)
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
    first = BESIDE + max(signal.delays)
    rows = np.arange(first, len(signal.y))
    harmonics = max(1, min(HARMONICS, int(period / LEAST_PER_HARMONIC)))
    columns = [*signal.columns(BESIDE, first), np.ones(len(rows))]
    wave = waves_of(np.asarray(2 * np.pi / period * rows, dtype=np.float64), harmonics)
    table = np.column_stack([*columns, wave])
    scale = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    theta = np.linalg.lstsq(table / scale, signal.y[rows], rcond=1e-10)[0] / scale
    return -theta[:BESIDE], theta[BESIDE : BESIDE * (1 + len(signal.inputs))].reshape(-1, BESIDE)


def independent(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of a constant and the columns, shape (N, q).

    Directions that are rounding are left out: OP of an exact controller follows from PV.
    """
    about = columns - columns.mean(axis=0)
    scale = np.maximum(np.linalg.norm(about, axis=0), 1e-300)
    left, sizes, _ = np.linalg.svd(about / scale, full_matrices=False)
    constant = np.full((len(columns), 1), 1.0 / np.sqrt(len(columns)))
    return np.concatenate([constant, left[:, sizes > DEPENDENT]], axis=1)
