"""The likelihood of what a simulation leaves of PV, under noise of its true form."""

import dataclasses
import math

import numpy as np
from scipy.linalg import block_diag

from stiction_studies.field.hidden import kernels
from stiction_studies.field.hidden.effect import LOAD, Effect
from stiction_studies.field.hidden.given import Kept, Noise
from stiction_studies.field.hidden.plants import Plant
from stiction_studies.field.hidden.simulation import LEAD
from stiction_studies.field.kernels import FlagArray, FloatArray

FLOOR = 1e-3  # of a variance: white noise beside what is held or drawn by lines
SAME = 1e-12  # of a column's squares: what is left of it is rounding
TINY = 1e-300


@dataclasses.dataclass(frozen=True)
class Form:
    """Noise as a linear system: s⁺ = F s + w, v = cᵀ s + e.

    Attributes:
        f, q: transition and covariance of w, shape (d, d).
        c: shape (d,).
        white: variance of e.
        start: covariance of s at the first sample, shape (d, d).
    """

    f: FloatArray
    q: FloatArray
    c: FloatArray
    white: float
    start: FloatArray

    def beside(self, other: "Form") -> "Form":
        """Return the sum of two noises that know nothing of each other."""
        return Form(
            np.ascontiguousarray(block_diag(self.f, other.f)),
            np.ascontiguousarray(block_diag(self.q, other.q)),
            np.concatenate([self.c, other.c]),
            self.white + other.white,
            np.ascontiguousarray(block_diag(self.start, other.start)),
        )


def true_form(noise: Noise, plant: Plant, sample_time: float, kept: Kept) -> Form:
    """Return the form of a loop's noise at its samples.

    Args:
        noise: of the loop.
        plant: whose equation noise may enter.
        sample_time: s.
        kept: what transmitter and record add to the output.
    """
    if kept.memory > 0.0:
        read = _first_order(kept.std, kept.memory, FLOOR * kept.std**2)
        return read.beside(_of_process(noise, plant, sample_time))
    process = _of_process(noise, plant, sample_time)
    return dataclasses.replace(process, white=kept.std**2)


def _of_process(noise: Noise, plant: Plant, sample_time: float) -> Form:
    """Return the form of what enters the process or its output."""
    if noise.equation:
        a, _, _ = plant.sampled(sample_time)
        d = len(a)
        f = np.eye(d, k=-1)
        f[0] = -a
        q = np.zeros((d, d))
        q[0, 0] = noise.equation**2
        start = np.zeros((d, d))
        for _ in range(LEAD):
            start = f @ start @ f.T + q
        return Form(f, q, np.eye(d)[0], 0.0, start)
    if noise.coloured:
        return _first_order(noise.coloured, noise.memory / sample_time, 0.0)
    nothing = np.zeros((1, 1))
    return Form(nothing, nothing, np.zeros(1), 0.0, nothing)


def _first_order(std: float, steps: float, white: float) -> Form:
    kept = math.exp(-1.0 / steps)
    share = np.array([[std**2]])
    return Form(np.array([[kept]]), (1.0 - kept**2) * share, np.ones(1), white, share)


def random_form(effect: Effect, plant: Plant, sample_time: float) -> Form:
    """Return the form of a random walk or of coloured noise, on the output or the stem."""
    if effect.name == "coloured":
        return _first_order(effect.figures["std"], effect.figures["tau"] / sample_time, 0.0)
    std = effect.figures["rate"] * math.sqrt(sample_time)
    if effect.place != LOAD:
        return Form(np.eye(1), np.array([[std**2]]), np.ones(1), 0.0, np.zeros((1, 1)))
    a, b, c = plant.stepped(sample_time)  # its dead time changes nothing but when
    d = len(c)
    f, q = np.zeros((d + 1, d + 1)), np.zeros((d + 1, d + 1))
    f[:d, :d], f[:d, d], f[d, d] = a, b, 1.0
    q[d, d] = std**2
    return Form(f, q, np.append(c, 0.0), 0.0, np.zeros_like(q))


class Likelihood:
    """ln L of residuals under one form of noise, its scale fitted, some columns left free.

    Args:
        form: of the noise.
        free: columns that any explanation may use: a constant, what the plant does by itself
            from another start, and what an integrating one does about another OP, shape (N, m).
        seen: samples that count, shape (N,).
    """

    def __init__(self, form: Form, free: FloatArray, seen: FlagArray) -> None:
        self.form, self.seen = form, seen
        self._gains, spread = kernels.kalman_gains(
            form.f, form.q, form.c, form.white, form.start, seen
        )
        self._spread = np.sqrt(spread)[:, None]
        self._count = int(seen.sum())
        self._log = float(np.log(spread[seen]).sum()) / 2.0
        self._basis, _ = np.linalg.qr(self._white(free))

    def _white(self, columns: FloatArray) -> FloatArray:
        columns = np.ascontiguousarray(np.where(self.seen[:, None], columns, 0.0))
        left = kernels.whitened(columns, self._gains, self.form.f, self.form.c) / self._spread
        left[~self.seen] = 0.0
        return left

    def bare(self, columns: FloatArray) -> FloatArray:
        """Return columns that are white under this noise and hold nothing of the free ones."""
        return self._without_free(self._white(columns))

    def _without_free(self, white: FloatArray) -> FloatArray:
        return np.asarray(white - self._basis @ (self._basis.T @ white))

    def of_squares(self, squares: FloatArray | float) -> FloatArray:
        """Return ln L, up to a constant, for sums of squares of bare residuals."""
        return np.asarray(-0.5 * self._count * np.log(np.maximum(squares, 1e-300)) - self._log)

    def of(self, residual: FloatArray) -> float:
        """Return ln L of a residual, shape (N,)."""
        bare = self.bare(residual[:, None])
        return float(self.of_squares(float((bare**2).sum())))

    def with_columns(self, residual: FloatArray, columns: FloatArray, each: int) -> FloatArray:
        """Return ln L of a residual with groups of columns fitted to it, shape (G,).

        Args:
            residual: shape (N,).
            columns: of the groups one after the other, shape (N, G · each).
            each: columns of a group, 1 or 2.
        """
        r = self.bare(residual[:, None])[:, 0]
        white = self._white(columns)
        bare = self._without_free(white)
        first, size = bare[:, ::each], (white[:, ::each] ** 2).sum(axis=0)
        norm = (first**2).sum(axis=0)
        gained = _gained(first.T @ r, norm, size)
        if each == 2:
            second, size = bare[:, 1::2], (white[:, 1::2] ** 2).sum(axis=0)
            second = second - first * ((first * second).sum(axis=0) / np.maximum(norm, TINY))
            gained = gained + _gained(second.T @ r, (second**2).sum(axis=0), size)
        return self.of_squares(float(r @ r) - gained)


def _gained(along: FloatArray, norm: FloatArray, size: FloatArray) -> FloatArray:
    """Return what columns explain; nothing where all but rounding is in the columns before them.

    Args:
        along: their products with the residual, shape (G,).
        norm: their squares without the columns before them.
        size: their squares.
    """
    return np.where(norm > SAME * size, along**2 / np.maximum(norm, TINY), 0.0)
