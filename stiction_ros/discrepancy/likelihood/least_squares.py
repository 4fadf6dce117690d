"""Least squares of whitened columns on the marked rows of a gap."""

import numpy as np
from scipy.linalg import qr

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.measures import MAJORITY, ROUNDING
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.signals.autoregression import TINY, inner_product, whitened_rows

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


@compiled
def coefficients(columns: FloatArray, target: FloatArray) -> FloatArray:
    """Return the factors of least squares, shape (q,); a column that earlier ones make up has 0.

    By Gram-Schmidt. A column that loses most of its length is made orthogonal once more.

    Args:
        columns: shape (q, n).
        target: shape (n,).
    """
    count = len(columns)
    basis, factor, beta = columns.copy(), np.zeros((count, count)), np.zeros(count)
    for i in range(count):
        whole = left = np.sqrt(inner_product(basis[i], basis[i]))
        before = np.inf
        while left < MAJORITY * before and left > ROUNDING * whole:
            before = left
            for j in range(i):
                share = inner_product(basis[j], basis[i])
                factor[j, i] += share
                for n in range(len(target)):
                    basis[i, n] -= share * basis[j, n]
            left = np.sqrt(inner_product(basis[i], basis[i]))
        kept = left > max(ROUNDING * whole, NOTHING)
        factor[i, i] = left if kept else np.inf
        for n in range(len(target)):
            basis[i, n] = basis[i, n] / left if kept else 0.0
    for i in range(count - 1, -1, -1):
        value = inner_product(basis[i], target)
        for k in range(i + 1, count):
            value -= factor[i, k] * beta[k]
        beta[i] = value / factor[i, i]
    return beta


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
