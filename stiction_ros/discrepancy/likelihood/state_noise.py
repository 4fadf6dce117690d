"""Noise by its states: what one-step predictions of a state-space model miss, compiled."""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.likelihood.kernels import DEPENDENT
from stiction_ros.discrepancy.likelihood.noise import BoolArray
from stiction_ros.effects import FloatArray

DOUBLINGS = 30
_TINY = 1e-300


def steady_gain(
    a: FloatArray, q: FloatArray, c: FloatArray, r: float
) -> tuple[FloatArray, float] | None:
    """Return Kalman's gain, shape (n,), and the variance of what its predictions miss.

    By doubling; None where there is no steady one.

    Args:
        a, q: of the states, shape (n, n).
        c: of the one output, shape (n,).
        r: its variance.
    """
    if not len(a):
        return np.zeros(0), r
    identity = np.eye(len(a))
    forward, seen, p = a.T.copy(), np.outer(c, c) / r, q.copy()
    for _ in range(DOUBLINGS):
        try:
            inner = np.linalg.solve(identity + seen @ p, forward)
        except np.linalg.LinAlgError:
            return None
        grown = p + forward.T @ p @ inner
        seen = seen + forward @ np.linalg.solve(identity + seen @ p, seen) @ forward.T
        forward = forward @ inner
        change = float(np.abs(grown - p).max())
        p = 0.5 * (grown + grown.T)
        if not np.isfinite(p).all():
            return None
        if change <= 1e-10 * float(np.abs(p).max()):
            break
    missed = float(c @ p @ c) + r
    return np.asarray(a @ p @ c / missed), missed


@compiled
def innovations(
    kept: FloatArray, gain: FloatArray, look: FloatArray, values: FloatArray
) -> FloatArray:
    """Return what one-step predictions miss of each row of ``values``, shape (G, N).

    Args:
        kept: A − K c, shape (n, n).
        gain: K, shape (n,).
        look: c, shape (n,).
        values: shape (G, N).
    """
    columns, count = values.shape
    size = len(gain)
    missed = np.empty((columns, count))
    state, following = np.zeros(size), np.zeros(size)
    for g in range(columns):
        state[:] = 0.0
        for k in range(count):
            foretold = 0.0
            for i in range(size):
                foretold += look[i] * state[i]
            missed[g, k] = values[g, k] - foretold
            for i in range(size):
                total = gain[i] * values[g, k]
                for j in range(size):
                    total += kept[i, j] * state[j]
                following[i] = total
            for i in range(size):
                state[i] = following[i]
    return missed


@compiled
def left_by_columns(
    white: FloatArray, values: FloatArray, rows: BoolArray, vanished: float
) -> FloatArray:
    """Return what least squares on the marked rows leave of the first one, shape (N,).

    Args:
        white: a target and its columns, whitened, shape (1 + q, N).
        values: the same before, of which a column has to keep the share ``vanished`` to count.
        rows: shape (N,).
        vanished: of a column's length.
    """
    count = white.shape[1]
    basis, used = np.empty((len(white) - 1, count)), 0
    left: FloatArray = white[0].copy()
    for g in range(1, len(white)):
        after, before = _length(white[g], rows), _length(values[g], rows)
        if not after > vanished * max(before, _TINY):
            continue
        column = white[g] / after
        for _ in range(2):  # twice is enough
            for other in range(used):
                share = 0.0
                for k in range(count):
                    if rows[k]:
                        share += basis[other, k] * column[k]
                for k in range(count):
                    column[k] -= share * basis[other, k]
        length = _length(column, rows)
        if not length > DEPENDENT:
            continue
        share = 0.0
        for k in range(count):
            column[k] /= length
            if rows[k]:
                share += column[k] * left[k]
        for k in range(count):
            left[k] -= share * column[k]
            basis[used, k] = column[k]
        used += 1
    return left


@compiled
def _length(values: FloatArray, rows: BoolArray) -> float:
    """Return the length of values on the marked rows."""
    total = 0.0
    for k in range(len(values)):
        if rows[k]:
            total += values[k] * values[k]
    return float(np.sqrt(total))
