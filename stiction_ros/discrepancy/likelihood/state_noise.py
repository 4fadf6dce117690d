"""Noise by its states: what one-step predictions of a state-space model miss."""

import numpy as np
from scipy.linalg import solve_discrete_are

from stiction_ros.discrepancy.likelihood.least_squares import coefficients
from stiction_ros.discrepancy.measures import ROUNDING
from stiction_ros.effects.behaviour import BoolArray, FloatArray


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
