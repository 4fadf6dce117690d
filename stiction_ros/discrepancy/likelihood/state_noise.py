"""Noise by its states: what one-step predictions of a state-space model miss, compiled."""

import numpy as np
from scipy.linalg import solve_discrete_are

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.likelihood.least_squares import coefficients
from stiction_ros.discrepancy.measures import ROUNDING
from stiction_ros.effects.behaviour import BoolArray, FloatArray

STEADY = 1e-13  # of a gain and of a variance: what changes less from row to row stays


def steady_gain(
    a: FloatArray, q: FloatArray, c: FloatArray, r: float
) -> tuple[FloatArray, float] | None:
    """Return Kalman's gain, shape (n,), and the variance of what its predictions miss.

    None where there is no steady one.

    Args:
        a, q: of the states, shape (n, n).
        c: of the one output, shape (n,).
        r: its variance.
    """
    if not len(a):
        return np.zeros(0), r
    try:
        p = solve_discrete_are(a.T, c[:, None], q, np.array([[r]]))
    except ValueError:  # LinAlgError is one
        return None
    missed = float(c @ p @ c) + r
    return np.asarray(a @ p @ c / missed), missed


@compiled
def innovations(
    a: FloatArray,
    q: FloatArray,
    c: FloatArray,
    r: float,
    start: FloatArray,
    values: FloatArray,
    seen: BoolArray,
    begins: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Return what one-step predictions miss of each row of ``values``, and their variances.

    The predictions are those of a Kalman filter that begins with each record, so that it needs
    no steady state: what is not known of the states at first is foretold as such. Innovations
    are in units of their standard deviations, shape (G, N); variances have the shape (N,).

    Args:
        a, q: of the states, shape (n, n).
        c: of the one output, shape (n,).
        r: its variance.
        start: covariance of the states at the first sample of a record, shape (n, n).
        values: shape (G, N).
        seen: rows that are measurements, shape (N,); the others are foretold alone.
        begins: first rows of records, shape (N,).
    """
    columns, count = values.shape
    size = len(c)
    missed, variance = np.empty((columns, count)), np.empty(count)
    states, p = np.zeros((columns, size)), start.copy()
    shown, moved, gain = np.zeros(size), np.zeros((size, size)), np.zeros(size)
    following = np.zeros(size)
    total, unit, steady = r, 1.0, False
    for k in range(count):
        if begins[k]:
            states[:] = 0.0
            p[:] = start
            steady = False
        if not (steady and seen[k]):
            before, total = total, r
            for i in range(size):
                shown[i] = 0.0
                for j in range(size):
                    shown[i] += p[i, j] * c[j]
                total += c[i] * shown[i]
            unit = np.sqrt(total)
            steady = seen[k] and abs(total - before) <= STEADY * total
            for i in range(size):
                old = gain[i]
                gain[i] = 0.0
                for j in range(size):
                    gain[i] += a[i, j] * shown[j] / total if seen[k] else 0.0
                steady = steady and abs(gain[i] - old) <= STEADY * (1.0 + abs(old))
                for j in range(size):
                    moved[i, j] = 0.0
                    for m in range(size):
                        moved[i, j] += a[i, m] * p[m, j]
            for i in range(size):
                for j in range(i, size):
                    value = q[i, j] - gain[i] * gain[j] * total
                    for m in range(size):
                        value += moved[i, m] * a[j, m]
                    steady = steady and abs(value - p[i, j]) <= STEADY * (1.0 + abs(value))
                    p[i, j] = p[j, i] = value
        variance[k] = total
        for g in range(columns):
            left = values[g, k]
            for i in range(size):
                left -= c[i] * states[g, i]
            missed[g, k] = left / unit
            for i in range(size):
                following[i] = gain[i] * left
                for j in range(size):
                    following[i] += a[i, j] * states[g, j]
            for i in range(size):
                states[g, i] = following[i]
    return missed, variance


def left_by_columns(white: FloatArray, values: FloatArray, rows: BoolArray) -> FloatArray:
    """Return what least squares on the marked rows leave of the first one, shape (N,).

    Args:
        white: a target and its columns, whitened, shape (1 + q, N).
        values: the same before; a column of which whitening leaves nothing does not count.
        rows: shape (N,).
    """
    after, before = (np.linalg.norm(each[1:, rows], axis=1) for each in (white, values))
    columns = white[1:][after > ROUNDING * before]
    return np.asarray(white[0] - coefficients(columns[:, rows], white[0, rows]) @ columns)
