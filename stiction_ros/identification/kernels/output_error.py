"""What the descent over A and D of a free-run fit evaluates, compiled.

The fit is :mod:`stiction_ros.identification.problem.output_error`.

A *problem* is what stays the same during a fit, a *point* what (A, D) gives: the solution of
everything linear. What that leaves and what its derivative needs are long rows, which live in
a *room* that all evaluations of a descent share, so that none of them asks for memory.
"""

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled, compiled_fused
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.kernels.row import (
    averaged,
    differences,
    driven_rows,
    factor,
    lag_products,
    solved,
)

FREE_RUN_WEIGHT = 0.02
THIN = 4


class Problem(NamedTuple):
    """One output, the signals that drive it and the window of its criterion."""

    y: FloatArray  # output, shape (N,)
    # the stems, an impulse and y, each after ``pad`` zeros, shape (m + 2, pad + N)
    signals: FloatArray
    lags: IntArray  # first lag of each stem, shape (m,)
    inputs: int  # n_b, number of lags of each stem
    pad: int  # zeros before the first sample
    begin: int  # begin, first: first sample of the free run and of the innovations
    first: int
    energy: float  # Σy² over the window


class Room(NamedTuple):
    """Room for the rows of one evaluation at a time, n samples from ``begin`` on."""

    driven: FloatArray  # the signals through 1/A, shape (m + 2, pad + N)
    plain: FloatArray  # linear columns of the free run, as rows, shape (q, n)
    # linear columns of innovations and priced w, as rows; then the target, which the residual
    # replaces; then the derivatives, shape (q + 1 + n_a + p, n')
    rows: FloatArray
    slope: FloatArray  # the free run through 1/A after zeros, shape (2, pad + n)
    slopes: FloatArray  # its differences, shape (n_a, n)
    moved: FloatArray  # a signal through D, shape (pad + N,)
    # of the differences of n_b and of n_a lags: differences = table · lags
    tables: tuple[FloatArray, FloatArray]


class Point(NamedTuple):
    """The variable-projection solution at (A, D)."""

    a: FloatArray  # a, noise: monic polynomials A and D
    noise: FloatArray
    theta: FloatArray  # coefficients of the differences of lags, shape (q,); 0 where left out
    root: FloatArray  # Cholesky factor of the Gram matrix of the kept rows, in the upper left
    kept: IntArray  # which rows are kept, the first ``number``
    number: int  # of kept rows
    free_run: FloatArray  # simulated output from ``begin`` on
    energy: float  # sum of squares of the innovations
    total: float  # the same with priced w
    weight: float  # price of Σw²


@compiled
def _price(problem: Problem, scale: float, x: FloatArray, row: FloatArray) -> None:
    """Write the priced samples of x, a signal from ``begin`` on, to the end of a row.

    Σw² is priced at all samples before the first innovation, as nothing else holds the
    initial state there, then at every THIN-th.
    """
    count = len(problem.y) - problem.first
    p, end = problem.first - problem.begin, row[count:]
    for i in range(p):
        end[i] = scale * x[i]
    later, thinned, root = row[count + p :], x[p:], scale * np.sqrt(float(THIN))
    for i in range(len(later)):
        later[i] = root * thinned[THIN * i]


@compiled
def _columns(
    problem: Problem, room: Room, noise: FloatArray, scale: float, place: tuple[int, int, int]
) -> None:
    """Write the columns of one signal; ``place`` is the signal, its first lag, their row."""
    signal, lag, row = place
    stem = signal < len(problem.lags)
    table = room.tables[0] if stem else room.tables[1]
    x, number = room.driven[signal], len(table)
    begin, shift = problem.pad + problem.begin - lag, problem.first - problem.begin
    differences(table, x, begin, len(problem.y) - problem.begin, room.plain, row)
    count = len(problem.y) - problem.first
    averaged(noise, x, begin + shift - number + 1, count + number - 1, room.moved)
    differences(table, room.moved, number - 1, count, room.rows, row)
    for i in range(row, row + number):
        _price(problem, scale, room.plain[i], room.rows[i])


@compiled
def evaluate(
    problem: Problem, room: Room, a: FloatArray, noise: FloatArray, weight: float
) -> Point:
    """Return the point of (A, D); ``weight`` 0 is for innovations only."""
    y, rows = problem.y, room.rows
    count, valves, size = len(y) - problem.first, len(problem.lags), len(room.plain)
    scale, level = np.sqrt(weight), size - len(a)
    driven_rows(a, problem.signals, 0, valves + 1, room.driven)
    for j in range(valves + 1):
        lag = problem.lags[j] if j < valves else 0
        row = j * problem.inputs if j < valves else level + 1
        _columns(problem, room, noise, scale, (j, lag, row))
    level_of_noise = 0.0
    for value in noise:
        level_of_noise += value
    for k in range(count):
        rows[level, k] = level_of_noise
    _price(problem, scale, room.plain[level], rows[level])
    averaged(noise, y, problem.first, count, rows[size])
    _price(problem, scale, y[problem.begin :], rows[size])
    gram = np.dot(rows[: size + 1], rows[: size + 1].T)
    root, kept, number = factor(gram, size)
    theta = solved(root, kept, number, gram[size], size)
    residual, free_run = rows[size], np.dot(theta, room.plain)
    explained = np.dot(theta, rows[:size])
    for k in range(len(residual)):
        residual[k] -= explained[k]
    energy = np.dot(residual[:count], residual[:count])
    total = energy + np.dot(residual[count:], residual[count:])
    return Point(a, noise, theta, root, kept, number, free_run, energy, total, weight)


@compiled_fused
def normal_equations(problem: Problem, room: Room, point: Point) -> tuple[FloatArray, FloatArray]:
    """Return Gram matrix and gradient over (a, d) with the linear part projected out.

    Kaufman's form of the derivative of the variable projection, of the point that was
    evaluated last. As with the linear columns, the lags of A are replaced by their differences.
    """
    order, p, rows = len(point.a) - 1, len(point.noise) - 1, room.rows
    count, pad, size = len(problem.y) - problem.first, problem.pad, len(room.plain)
    shift, table, length = problem.first - problem.begin, room.tables[1], len(point.free_run)
    # dŷ/da_i = −q^-i ŷ/A; what started before `begin` lies in the span of the initial terms.
    free_run = room.slope[1, pad:]
    for k in range(length):
        free_run[k] = point.free_run[k]
    driven_rows(point.a, room.slope[1:], 0, 1, room.slope)
    differences(table, room.slope[0], pad - 1, length, room.slopes, 0)
    averaged(point.noise, room.slope[0], pad + shift - order, count + order - 1, room.moved)
    differences(table, room.moved, order - 1, count, rows, size + 1)
    for i in range(order):
        _price(problem, np.sqrt(point.weight), room.slopes[i], rows[size + 1 + i])
    w = problem.y[problem.begin :] - point.free_run
    for i in range(p):
        row, lagged = rows[size + 1 + order + i], w[shift - 1 - i :]
        for k in range(count):
            row[k] = lagged[k]
    products = np.empty((order + p, size + 1))
    gram, cross = np.empty((order + p, order + p)), np.empty(point.number)
    of_a = np.dot(rows[size + 1 : size + 1 + order], rows.T)
    of_noise = np.dot(rows[size + 1 + order :], rows[: size + 1].T)
    lags = lag_products(w, p)
    for c in range(order + p):
        for i in range(size + 1):
            products[c, i] = of_a[c, i] if c < order else of_noise[c - order, i]
        for i in range(c + 1):
            if i < order:
                gram[c, i] = of_a[i, size + 1 + c]
            else:
                gram[c, i] = lags[1 + i - order, 1 + c - order]
    crosses = np.empty((order + p, point.number))
    for c in range(order + p):
        for i in range(point.number):
            value = products[c, point.kept[i]]
            for j in range(i):
                value -= point.root[i, j] * cross[j]
            cross[i] = value / point.root[i, i]
            crosses[c, i] = cross[i]
        for other in range(c + 1):
            for i in range(point.number):
                gram[c, other] -= crosses[c, i] * crosses[other, i]
            gram[other, c] = gram[c, other]
    gradient = np.empty(order + p)
    for c in range(order + p):
        gradient[c] = products[c, size]
    return gram, gradient


@compiled
def arx_polynomial(problem: Problem, room: Room, a: FloatArray) -> FloatArray:
    """Return A of the ARX model, (15), of data filtered by 1/A: y by its lags.

    Differences instead of lags, as with the linear columns.
    """
    rows, valves, order = room.rows, len(problem.lags), len(a) - 1
    count, size, at = len(problem.y) - problem.first, len(room.plain), problem.pad + problem.first
    driven_rows(a, problem.signals, 0, valves + 2, room.driven)
    for row in range(size + 1):
        priced = rows[row, count:]
        for k in range(len(priced)):
            priced[k] = 0.0
    differences(room.tables[1], room.driven[valves + 1], at - 1, count, rows, 0)
    for j in range(valves):
        row = order + j * problem.inputs
        differences(room.tables[0], room.driven[j], at - problem.lags[j], count, rows, row)
    level, target, y = rows[size - 1], rows[size], room.driven[valves + 1, at:]
    for k in range(count):
        level[k], target[k] = 1.0, y[k]
    gram = np.dot(rows[: size + 1], rows[: size + 1].T)
    root, kept, number = factor(gram, size)
    theta = solved(root, kept, number, gram[size], size)
    out = np.ones(order + 1)
    for j in range(order):
        out[1 + j] = 0.0
        for i in range(j, order):
            out[1 + j] -= room.tables[1][i, j] * theta[i]
    return out
