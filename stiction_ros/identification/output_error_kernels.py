"""What the descent over A and D of :mod:`.output_error` evaluates, compiled.

A *problem* is what stays the same during a fit, a *point* what (A, D) gives: the solution of
everything linear, the residual and what its derivative needs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray

IntArray = NDArray[np.int64]

DEPENDENT = 1e-6  # pivot of a scaled column, as a root, below which it depends on the others
EMPTY = 1e-12


class Problem(NamedTuple):
    """One output, the signals that drive it and the window of its criterion.

    Attributes:
        y: output, shape (N,).
        signals: stems, a constant and an impulse before the window, shape (s, N).
        groups: rows (signal, first lag, number of lags): the linear columns.
        begin, first: first sample of the free run and of the innovations.
        priced: samples, from ``begin`` on, at which Σw² is priced.
        prices: root of each one's weight.
    """

    y: FloatArray
    signals: FloatArray
    groups: IntArray
    begin: int
    first: int
    priced: IntArray
    prices: FloatArray


class Point(NamedTuple):
    """The variable-projection solution at (A, D).

    Attributes:
        a, noise: monic polynomials A and D.
        theta: coefficients of the differences of lags, shape (q,); 0 where left out.
        rows: linear columns of innovations and priced w, those kept, shape (q', n').
        root: Cholesky factor of their Gram matrix, shape (q', q').
        free_run: simulated output from ``begin`` on.
        residual: innovations, then priced w, shape (n',).
        weight: price of Σw².
    """

    a: FloatArray
    noise: FloatArray
    theta: FloatArray
    rows: FloatArray
    root: FloatArray
    free_run: FloatArray
    residual: FloatArray
    weight: float


@compiled
def _driven(x: FloatArray, a: FloatArray) -> FloatArray:
    """Return x / A from rest, shape (N,)."""
    out = np.empty(len(x))
    order = len(a) - 1
    for k in range(len(x)):
        value = x[k]
        for i in range(min(order, k), 0, -1):
            value -= a[i] * out[k - i]
        out[k] = value
    return out


@compiled
def _averaged(x: FloatArray, d: FloatArray) -> FloatArray:
    """Return D x from rest, shape (N,)."""
    out = x.copy()
    for i in range(1, len(d)):
        weight = d[i]
        for k in range(i, len(x)):
            out[k] += weight * x[k - i]
    return out


@compiled
def _fill(rows: FloatArray, row: int, x: FloatArray, start: int, count: int) -> None:
    """Write x and its first differences, from ``start`` on, into ``count`` rows."""
    length = min(rows.shape[1], len(x) - start)
    now = x.copy()
    for i in range(count):
        for k in range(length):
            rows[row + i, k] = now[start + k]
        for k in range(len(x) - 1, 0, -1):
            now[k] -= now[k - 1]


@compiled
def _factor(gram: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the Cholesky factor of the kept rows of a Gram matrix, and which are kept.

    Rows that depend on those before them are left out.
    """
    size = len(gram)
    scale = np.empty(size)
    for i in range(size):
        scale[i] = np.sqrt(gram[i, i]) + 1e-300
    largest = scale.max()
    kept = np.empty(size, dtype=np.int64)
    root = np.zeros((size, size))
    number = 0
    for i in range(size):
        if not scale[i] > EMPTY * largest:
            continue
        rest = gram[i, i]
        for j in range(number):
            value = gram[i, kept[j]]
            for before in range(j):
                value -= root[number, before] * root[j, before]
            value /= root[j, j]
            root[number, j] = value
            rest -= value * value
        if rest > (DEPENDENT * scale[i]) ** 2:
            root[number, number] = np.sqrt(rest)
            kept[number] = i
            number += 1
    return root[:number, :number].copy(), kept[:number].copy()


@compiled
def _lower_solve(root: FloatArray, right: FloatArray) -> FloatArray:
    """Return L⁻¹ R for R of shape (q, c)."""
    out = right.copy()
    for i in range(len(root)):
        for j in range(i):
            out[i] -= root[i, j] * out[j]
        out[i] /= root[i, i]
    return out


@compiled
def evaluate(problem: Problem, a: FloatArray, noise: FloatArray, weight: float) -> Point:
    """Return the point of (A, D); ``weight`` 0 is for innovations only."""
    y, begin, first = problem.y, problem.begin, problem.first
    count = len(y) - first
    priced = len(problem.priced) if weight > 0.0 else 0
    size = 0
    for group in problem.groups:
        size += group[2]
    plain = np.empty((size, len(y) - begin))
    rows = np.empty((size, count + priced))
    row = 0
    for g in range(len(problem.groups)):
        signal, lag, number = problem.groups[g]
        driven = _driven(problem.signals[signal], a)
        _fill(plain, row, driven, begin - lag, number)
        _fill(rows[:, :count], row, _averaged(driven, noise), first - lag, number)
        row += number
    target = np.empty(count + priced)
    target[:count] = _averaged(y[begin:], noise)[first - begin :]
    scale = np.sqrt(weight)
    for i in range(priced):
        price, at = scale * problem.prices[i], problem.priced[i]
        target[count + i] = price * y[begin + at]
        for q in range(size):
            rows[q, count + i] = price * plain[q, at]
    root, kept = _factor(rows @ rows.T)
    rows = rows[kept]
    solution = _lower_solve(root, (rows @ target).reshape(-1, 1))[:, 0].copy()
    for i in range(len(kept) - 1, -1, -1):
        for j in range(i + 1, len(kept)):
            solution[i] -= root[j, i] * solution[j]
        solution[i] /= root[i, i]
    theta = np.zeros(size)
    for i in range(len(kept)):
        theta[kept[i]] = solution[i]
    return Point(a, noise, theta, rows, root, theta @ plain, target - solution @ rows, weight)


@compiled
def normal_equations(
    problem: Problem, point: Point, table: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return Gram matrix and gradient over (a, d) with the linear part projected out.

    Kaufman's form of the derivative of the variable projection. As with the linear columns,
    the lags of A are replaced by their differences, ``table`` times lags.
    """
    order, p = len(point.a) - 1, len(point.noise) - 1
    count = len(problem.y) - problem.first
    # dŷ/da_i = −q^-i ŷ/A; what started before `begin` lies in the span of the initial terms.
    driven = _driven(point.free_run, point.a)
    slope = np.zeros(order + len(driven))
    slope[order:] = _averaged(driven, point.noise)
    jacobian = np.zeros((order + p, len(point.residual)))
    lags = np.empty((order, len(point.residual)))
    for i in range(1, order + 1):
        start = order + p - i
        lags[i - 1, :count] = slope[start : start + count]
    scale = np.sqrt(point.weight)
    for place in range(len(point.residual) - count):
        price, at = scale * problem.prices[place], problem.priced[place]
        for i in range(1, order + 1):
            lags[i - 1, count + place] = price * driven[at - i] if at >= i else 0.0
    jacobian[:order] = table @ lags
    w = problem.y[problem.begin :] - point.free_run
    for i in range(1, p + 1):
        jacobian[order + i - 1, :count] = w[p - i : p - i + count]
    cross = _lower_solve(point.root, point.rows @ jacobian.T)
    return jacobian @ jacobian.T - cross.T @ cross, jacobian @ point.residual


@compiled
def is_stable(a: FloatArray, radius: float) -> bool:
    """Return whether all roots of a monic polynomial lie inside a circle (Schur and Cohn)."""
    order = len(a) - 1
    now = a.copy()
    for i in range(1, order + 1):
        now[i] /= radius**i
    for size in range(order, 0, -1):
        last = now[size]
        if not abs(last) < 1.0:
            return False
        shrunk = 1.0 - last * last
        before = now.copy()
        for i in range(1, size):
            now[i] = (before[i] - last * before[size - i]) / shrunk
    return True
