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

FREE_RUN_WEIGHT = 0.02
MAX_RADIUS = 0.9995
HARDEST = 1e6  # damping
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
def _driven(signals: FloatArray, a: FloatArray) -> FloatArray:
    """Return signals / A from rest, shape (s, N)."""
    rows, count = signals.shape
    out = np.empty((rows, count))
    order = len(a) - 1
    for k in range(count):
        for s in range(rows):
            value = signals[s, k]
            for i in range(min(order, k), 0, -1):
                value -= a[i] * out[s, k - i]
            out[s, k] = value
    return out


@compiled
def _averaged(x: FloatArray, d: FloatArray, begin: int) -> FloatArray:
    """Return D x from sample ``begin`` on, x at rest before its first sample."""
    out = x[begin:].copy()
    for i in range(1, len(d)):
        weight, skip = d[i], max(i - begin, 0)
        to, part = out[skip:], x[begin - i + skip : len(x) - i]
        for k in range(len(to)):
            to[k] += weight * part[k]
    return out


@compiled
def _fill(rows: FloatArray, row: int, x: FloatArray, start: int, count: int, columns: int) -> None:
    """Write x and its first differences, from ``start`` on, into ``count`` rows."""
    length = min(columns, len(x) - start)
    now = x[max(start - count, 0) : start + length].copy()
    at = start - max(start - count, 0)
    for i in range(count):
        for k in range(length):
            rows[row + i, k] = now[at + k]
        if i + 1 < count:
            before, now = now, np.empty_like(now)
            now[0] = before[0]
            for k in range(1, len(now)):
                now[k] = before[k] - before[k - 1]


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
def _rows_kept(rows: FloatArray, kept: IntArray) -> FloatArray:
    """Return some of the rows; all of them as they are."""
    if len(kept) == len(rows):
        return rows
    out = np.empty((len(kept), rows.shape[1]))
    for i in range(len(kept)):
        for k in range(rows.shape[1]):
            out[i, k] = rows[kept[i], k]
    return out


@compiled
def _lower_solve(root: FloatArray, right: FloatArray) -> FloatArray:
    """Return L⁻¹ R for R of shape (q, c)."""
    out = right.copy()
    for i in range(len(root)):
        for c in range(out.shape[1]):
            for j in range(i):
                out[i, c] -= root[i, j] * out[j, c]
            out[i, c] /= root[i, i]
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
    driven = _driven(problem.signals, a)
    for g in range(len(problem.groups)):
        signal, lag, number = problem.groups[g]
        _fill(plain, row, driven[signal], begin - lag, number, len(y) - begin)
        early = max(first - lag - number, 0)
        moving = _averaged(driven[signal], noise, early)
        _fill(rows, row, moving, first - lag - early, number, count)
        row += number
    target = np.empty(count + priced)
    moving = _averaged(y[begin:], noise, first - begin)
    for i in range(count):
        target[i] = moving[i]
    scale = np.sqrt(weight)
    for i in range(priced):
        target[count + i] = scale * problem.prices[i] * y[begin + problem.priced[i]]
    for q in range(size):
        one = plain[q]
        for i in range(priced):
            rows[q, count + i] = scale * problem.prices[i] * one[problem.priced[i]]
    root, kept = _factor(np.dot(rows, rows.T))
    rows = _rows_kept(rows, kept)
    solution = _lower_solve(root, np.dot(rows, target).reshape(-1, 1))[:, 0].copy()
    for i in range(len(kept) - 1, -1, -1):
        for j in range(i + 1, len(kept)):
            solution[i] -= root[j, i] * solution[j]
        solution[i] /= root[i, i]
    theta = np.zeros(size)
    for i in range(len(kept)):
        theta[kept[i]] = solution[i]
    residual = np.dot(solution, rows)
    for i in range(len(residual)):
        residual[i] = target[i] - residual[i]
    return Point(a, noise, theta, rows, root, np.dot(theta, plain), residual, weight)


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
    driven = _driven(point.free_run.reshape(1, -1), point.a)[0]
    slope = np.zeros(order + len(driven))
    moving = _averaged(driven, point.noise, 0)
    for k in range(len(driven)):
        slope[order + k] = moving[k]
    jacobian = np.zeros((order + p, len(point.residual)))
    lags = np.empty((order, len(point.residual)))
    for i in range(1, order + 1):
        start = order + p - i
        for k in range(count):
            lags[i - 1, k] = slope[start + k]
    scale = np.sqrt(point.weight)
    for i in range(1, order + 1):
        for place in range(len(point.residual) - count):
            price, at = scale * problem.prices[place], problem.priced[place]
            lags[i - 1, count + place] = price * driven[at - i] if at >= i else 0.0
    for i in range(order):
        for j in range(order):
            for k in range(len(point.residual)):
                jacobian[i, k] += table[i, j] * lags[j, k]
    begin = problem.begin
    for i in range(1, p + 1):
        for k in range(count):
            at = p - i + k
            jacobian[order + i - 1, k] = problem.y[begin + at] - point.free_run[at]
    cross = _lower_solve(point.root, np.dot(point.rows, jacobian.T))
    gram = np.dot(jacobian, jacobian.T)
    for i in range(order + p):
        for j in range(order + p):
            for q in range(len(cross)):
                gram[i, j] -= cross[q, i] * cross[q, j]
    return gram, np.dot(jacobian, point.residual)


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


@compiled
def _balance(gram: FloatArray, gradient: FloatArray) -> FloatArray:
    """Scale a system so that its diagonal is one, in place; return the scales."""
    size = len(gradient)
    scale = np.ones(size)  # a coefficient without influence stays where it is
    for i in range(size):
        if gram[i, i] > 1e-200:
            scale[i] = np.sqrt(gram[i, i])
    for i in range(size):
        gradient[i] /= scale[i]
        for j in range(size):
            gram[i, j] /= scale[i] * scale[j]
    return scale


@compiled
def _definite_solve(matrix: FloatArray, damping: float, right: FloatArray) -> FloatArray:
    """Return the solution with ``damping`` added to the diagonal; empty if not definite."""
    size = len(matrix)
    root, out = matrix.copy(), right.copy()
    for i in range(size):
        root[i, i] += damping
    for i in range(size):
        for j in range(i + 1):
            value = root[i, j]
            for before in range(j):
                value -= root[i, before] * root[j, before]
            if j < i:
                root[i, j] = value / root[j, j]
            elif value > 0.0:
                root[i, i] = np.sqrt(value)
            else:
                return np.empty(0)
        for j in range(i):
            out[i] -= root[i, j] * out[j]
        out[i] /= root[i, i]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            out[i] -= root[j, i] * out[j]
        out[i] /= root[i, i]
    return out


@compiled
def energy_of_output(problem: Problem) -> float:
    """Return Σy² over the window."""
    y = problem.y[problem.first :]
    return max(float(np.dot(y, y)), 1e-300)


@compiled
def loss_of(problem: Problem, point: Point) -> float:
    """Return n log(Σε²/n) + n κ Σw²/Σy²."""
    count = len(problem.y) - problem.first
    innovations = point.residual[:count]
    energy = max(np.dot(innovations, innovations), 1e-300)
    w = problem.y[problem.begin :] - point.free_run
    penalty = FREE_RUN_WEIGHT * np.dot(w, w) / energy_of_output(problem)
    return float(count * (np.log(energy / count) + penalty))


@compiled
def descend(
    problem: Problem, point: Point, table: FloatArray, most: int, least_gain: float
) -> Point:
    """Levenberg-Marquardt over (a, d) from ``point``, Σw² priced by its innovations.

    Ends after ``most`` iterations, or when one lowers the criterion by less than ``least_gain``.

    Args:
        table: of the differences of n_a lags, see :func:`normal_equations`.
    """
    count, order = len(problem.y) - problem.first, len(point.a) - 1
    innovations = point.residual[:count]
    weight = FREE_RUN_WEIGHT * np.dot(innovations, innovations) / energy_of_output(problem)
    damping, energy, before, done = 1e-4, np.inf, np.inf, -1
    gram, gradient, scale = np.empty((0, 0)), np.empty(0), np.empty(0)
    a, noise = point.a, point.noise
    while True:
        if is_stable(a, MAX_RADIUS) or done < 0:
            candidate = evaluate(problem, a, noise, weight)
            energy = np.dot(candidate.residual, candidate.residual)
            found = energy < before or done < 0
        else:
            found = False
        if found:
            point, done = candidate, done + 1
            damping = max(damping / 10.0, 1e-9) if done else damping
            little = (1.0 - energy / before) * count < least_gain and damping < 1e-5
            if done == most or (done and little):
                return point
            gram, gradient = normal_equations(problem, point, table)
            scale, before = _balance(gram, gradient), energy
        else:
            damping *= 5.0
        step = np.empty(0)
        while not len(step) and damping < HARDEST:
            step = _definite_solve(gram, damping, gradient)
            damping *= 1.0 if len(step) else 5.0
        if not len(step):
            return point
        a, noise = point.a.copy(), point.noise.copy()
        for i in range(order):
            for j in range(order):
                a[1 + j] -= table[i, j] * step[i] / scale[i]
        for i in range(len(noise) - 1):
            noise[1 + i] -= step[order + i] / scale[order + i]


@compiled
def arx_polynomial(problem: Problem, a: FloatArray, order: int) -> FloatArray:
    """Return the ARX model, (15), of data filtered by 1/A: y by the differences of its lags.

    Stems are replaced by their differences as well, as with the linear columns.
    """
    stems = len(problem.groups) - 2
    count = len(problem.y) - problem.first
    size = order + 1
    for g in range(stems):
        size += problem.groups[g, 2]
    signals = np.empty((stems + 1, len(problem.y)))
    for k in range(len(problem.y)):
        signals[0, k] = problem.y[k]
        for g in range(stems):
            signals[1 + g, k] = problem.signals[g, k]
    driven = _driven(signals, a)
    rows = np.empty((size, count))
    _fill(rows, 0, driven[0], problem.first - 1, order, count)
    row = order
    for g in range(stems):
        signal, lag, number = problem.groups[g]
        _fill(rows, row, driven[signal + 1], problem.first - lag, number, count)
        row += number
    for k in range(count):
        rows[row, k] = 1.0
    root, kept = _factor(np.dot(rows, rows.T))
    rows = _rows_kept(rows, kept)
    solution = _lower_solve(root, np.dot(rows, driven[0, problem.first :]).reshape(-1, 1))[:, 0]
    theta = np.zeros(size)
    for i in range(len(kept) - 1, -1, -1):
        value = solution[i]
        for j in range(i + 1, len(kept)):
            value -= root[j, i] * theta[kept[j]]
        theta[kept[i]] = value / root[i, i]
    return theta[:order].copy()
