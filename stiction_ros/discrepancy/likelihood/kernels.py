"""Whitened columns and least squares of one gap, compiled.

Columns are rows of their arrays here, so that inner loops run over samples.
"""

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.signals.autoregression import inner_product, whitened_rows

DOUBTFUL = 1e-8  # pivot of a scaled column below which the fast solution is not trusted,
DEPENDENT = 1e-10  # and below which the column adds nothing to the others
APART = 1e-3  # and above which the normal equations keep half of all digits
NOTHING = 1e-150  # length of a column that is zero on the fitted rows
_NEW = 1e-9  # of a scaled column that is no sum of others


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


@compiled
def _reflect(whole: FloatArray, step: int, pivot: int) -> None:
    """Put the pivot, which is not zero, in its place and eliminate what lies below it."""
    for k in range(whole.shape[1]):
        whole[step, k], whole[pivot, k] = whole[pivot, k], whole[step, k]
    vector = whole[step, step:].copy()
    length = np.sqrt(inner_product(vector, vector))
    length = -length if vector[0] > 0.0 else length
    vector[0] -= length
    half = inner_product(vector, vector) / 2.0
    for j in range(step, len(whole)):
        share = inner_product(vector, whole[j, step:]) / half
        for k in range(len(vector)):
            whole[j, step + k] -= share * vector[k]


@compiled
def least_squares(columns: FloatArray, target: FloatArray) -> tuple[bool, FloatArray]:
    """Return whether the solution can be trusted, and the coefficients of least squares.

    Householder's reflections with pivoting, columns scaled to one; columns that depend on
    others have a coefficient of zero.

    Args:
        columns: shape (q, n).
        target: shape (n,).
    """
    count, rows = columns.shape
    beta = np.zeros(count)
    if rows < count:
        return False, beta
    whole, scale = np.empty((count + 1, rows)), np.empty(count)
    order = np.empty(count, dtype=np.int64)
    for j in range(count):
        order[j] = j
        length = np.sqrt(inner_product(columns[j], columns[j]))
        scale[j] = length if length > NOTHING else np.inf
        for k in range(rows):
            whole[j, k] = columns[j, k] / scale[j]
    for k in range(rows):
        whole[count, k] = target[k]
    largest, rank = 0.0, 0
    for step in range(count):
        pivot, best = step, -1.0
        for j in range(step, count):
            left = inner_product(whole[j, step:], whole[j, step:])
            if left > best:
                pivot, best = j, left
        largest = max(largest, np.sqrt(best))
        if not np.sqrt(best) > DEPENDENT * largest:
            break
        if np.sqrt(best) < DOUBTFUL * largest:
            return False, beta
        _reflect(whole, step, pivot)
        order[step], order[pivot] = order[pivot], order[step]
        rank += 1
    for step in range(rank - 1, -1, -1):
        value = whole[count, step]
        for j in range(step + 1, rank):
            value -= whole[j, step] * beta[order[j]]
        beta[order[step]] = value / whole[step, step]
    for j in range(count):
        beta[j] /= scale[j]
    return True, beta


@compiled
def normal_equations(columns: FloatArray, target: FloatArray) -> tuple[bool, FloatArray]:
    """Return whether the columns are far from dependent, and the coefficients of least squares.

    Half as much work as :func:`least_squares`, and half as many digits.

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


@compiled
def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the columns, shape (r, n), those left out that depend.

    Args:
        columns: shape (q, n); used up.
    """
    count, rows = columns.shape
    largest, rank = 0.0, 0
    for j in range(count):
        length = np.sqrt(inner_product(columns[j], columns[j]))
        for k in range(rows):
            columns[j, k] /= length if length > NOTHING else np.inf
    for step in range(count):
        pivot, best = step, -1.0
        for j in range(step, count):
            left = inner_product(columns[j], columns[j])
            if left > best:
                pivot, best = j, left
        length = np.sqrt(best)
        largest = max(largest, length)
        if not length > _NEW * largest:
            break
        for k in range(rows):
            value = columns[pivot, k] / length
            columns[pivot, k] = columns[step, k]
            columns[step, k] = value
        for _ in range(2):  # twice is enough
            for j in range(step):
                share = inner_product(columns[j], columns[step])
                for k in range(rows):
                    columns[step, k] -= share * columns[j, k]
        length = np.sqrt(inner_product(columns[step], columns[step]))
        for k in range(rows):
            columns[step, k] /= length
        for j in range(step + 1, count):
            share = inner_product(columns[step], columns[j])
            for k in range(rows):
                columns[j, k] -= share * columns[step, k]
        rank += 1
    return columns[:rank].copy()


@compiled
def sums_of_squares(
    residual: FloatArray, ar: FloatArray, train: BoolArray, held: BoolArray, most: float
) -> tuple[int, float, int, float]:
    """Return number and squared innovations of the fitted rows, then of those kept back.

    Innovations kept back beyond ``most`` standard deviations of the fitted ones count as those.
    """
    inside, outside = whitened_rows(residual, ar, train), whitened_rows(residual, ar, held)
    total = inner_product(inside, inside)
    cap = most * most * total / max(len(inside), 1)
    kept = 0.0
    for n in range(len(outside)):
        kept += min(outside[n] * outside[n], cap)
    return len(inside), total, len(outside), kept


@compiled
def turn(
    columns: FloatArray, target: FloatArray, rows: BoolArray, ar: FloatArray
) -> tuple[bool, FloatArray]:
    """Return whether it can be trusted, and the coefficients of whitened least squares.

    Args:
        columns: shape (q, N).
        target: shape (N,).
        rows: that are fitted, shape (N,).
        ar: φ, shape (p,).
    """
    wanted = whitened_rows(target, ar, rows)
    white = np.empty((len(columns), len(wanted)))
    for j in range(len(columns)):
        column = whitened_rows(columns[j], ar, rows)
        for n in range(len(column)):
            white[j, n] = column[n]
    sure, beta = normal_equations(white, wanted)
    return (sure, beta) if sure else least_squares(white, wanted)
