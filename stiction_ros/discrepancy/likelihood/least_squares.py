"""Least squares of whitened columns on the marked rows of a gap."""

import numpy as np
from scipy.linalg import qr

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.measures import EPSILON, ROUNDING
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.signals.autoregression import TINY, inner_product, whitened_rows

APART = EPSILON**0.25  # of a scaled column, beside others: normal equations keep half of all digits
NOTHING = TINY**0.5  # length of a column that is zero on the fitted rows


@compiled
def whitened_block(
    columns: FloatArray, ar: FloatArray, rows: BoolArray, vanished: float
) -> FloatArray:
    """Return the marked rows of whitened columns, shape (q, n), zero where nothing is left.

    Args:
        columns: shape (q, N).
        ar: φ, shape (p,).
        rows: shape (N,).
        vanished: share of a column's length on those rows, up to which it is nothing.
    """
    count = 0
    for marked in rows:
        count += 1 if marked else 0
    white = np.empty((len(columns), count))
    for j in range(len(columns)):
        column = whitened_rows(columns[j], ar, rows)
        before = 0.0
        for k in range(len(rows)):
            if rows[k]:
                before += columns[j, k] * columns[j, k]
        nothing = inner_product(column, column) <= vanished * vanished * before
        for n in range(count):
            white[j, n] = 0.0 if nothing else column[n]
    return white


def whitened_columns(columns: FloatArray, ar: FloatArray, rows: BoolArray) -> FloatArray:
    """Return columns whitened, shape (n, q), zero where nothing but rounding is left of them.

    Noise of an equation that has settled hides how its run began.
    """
    block = whitened_block(np.ascontiguousarray(columns.T), ar, rows, ROUNDING)
    return np.asarray(block.T)


def coefficients(columns: FloatArray, target: FloatArray) -> FloatArray:
    """Return those of least squares; of columns that depend on each other, the smallest ones.

    Args:
        columns: shape (q, n).
        target: shape (n,).
    """
    apart, beta = _normal_equations(columns, target)
    if apart or not len(columns):
        return np.asarray(beta)
    scale = _lengths(columns.T)
    return np.asarray(np.linalg.lstsq(columns.T / scale, target, rcond=ROUNDING)[0] / scale)


@compiled
def _normal_equations(columns: FloatArray, target: FloatArray) -> tuple[bool, FloatArray]:
    """Return whether the columns are far from dependent, and the coefficients of least squares.

    Args:
        columns: shape (q, n).
        target: shape (n,).
    """
    count = len(columns)
    factor, beta, scale = np.empty((count, count)), np.zeros(count), np.empty(count)
    for i in range(count):
        scale[i] = np.sqrt(inner_product(columns[i], columns[i]))
        if not scale[i] > NOTHING:
            return False, beta
        for j in range(i + 1):
            value = inner_product(columns[i], columns[j]) / (scale[i] * scale[j])
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            factor[i, j] = value / factor[j, j] if j < i else np.sqrt(max(value, 0.0))
        if not factor[i, i] > APART:
            return False, beta
        value = inner_product(columns[i], target) / scale[i]
        for k in range(i):
            value -= factor[i, k] * beta[k]
        beta[i] = value / factor[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            beta[i] -= factor[k, i] * beta[k]
        beta[i] /= factor[i, i]
    for i in range(count):
        beta[i] /= scale[i]
    return True, beta


def projector(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the columns, shape (n, r), numerical dependence left out."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    basis, left, _ = qr(columns / _lengths(columns), mode="economic", pivoting=True)
    sizes = np.abs(np.diag(left))
    return np.ascontiguousarray(basis[:, : int(np.sum(sizes > ROUNDING * sizes[0]))])


def left_by(basis: FloatArray, values: FloatArray) -> FloatArray:
    """Return what an orthonormal basis, shape (n, r), leaves of values, shape (n, …)."""
    return np.asarray(values - basis @ (basis.T @ values))


def _lengths(columns: FloatArray) -> FloatArray:
    """Return the lengths of columns, shape (q,); inf of those that are zero."""
    sizes = np.linalg.norm(columns, axis=0)
    return np.where(sizes > NOTHING, sizes, np.inf)


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
