"""The starts of a free-run fit and the descent over A and D, compiled."""

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.kernels.output_error import (
    FREE_RUN_WEIGHT,
    Point,
    Problem,
    Room,
    arx_polynomial,
    evaluate,
    normal_equations,
)
from stiction_ros.identification.kernels.row import lag_products
from stiction_ros.signals.polynomials import is_stable, pulled_inside

MAX_RADIUS = 0.9995
START_RADIUS = 0.99
REFINEMENTS = 4  # of the start, as Steiglitz and McBride
FIRST, LEAST, HARDEST = 1e-4, 1e-9, 1e6  # damping


class Start(NamedTuple):
    """Where a descent starts."""

    a: FloatArray  # a, noise: monic polynomials A and D
    noise: FloatArray
    energy: float  # sum of squares of the innovations; 0 where it is not known


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
def descend(
    problem: Problem, room: Room, start: Start, most: int, gains: tuple[float, float]
) -> Point:
    """Levenberg-Marquardt over (a, d) from ``start``, Σw² priced by its innovations.

    Ends after ``most`` iterations, or when one lowers the criterion by less than the first of
    ``gains``, or when a full step of Gauss and Newton promises less than the second.
    """
    count, order, table = len(problem.y) - problem.first, len(start.a) - 1, room.tables[1]
    a, noise, weight = start.a, start.noise, FREE_RUN_WEIGHT * start.energy / problem.energy
    damping, before, done, priced = FIRST, np.inf, -1, weight > 0.0
    gram, gradient, scale = np.empty((0, 0)), np.empty(0), np.empty(0)
    while True:
        found = False
        if done < 0 or is_stable(a, MAX_RADIUS):
            candidate = evaluate(problem, room, a, noise, weight)
            found = candidate.total < before
        if not priced:
            weight, priced = FREE_RUN_WEIGHT * candidate.energy / problem.energy, True
            continue
        if found or done < 0:
            point, done = candidate, done + 1
            damping = max(damping / 10.0, LEAST) if done else damping
            little = (1.0 - point.total / before) * count < gains[0] and damping < 1e-5
            if done == most or (done and little):
                return point
            gram, gradient = normal_equations(problem, room, point)
            scale, before = _balance(gram, gradient), point.total
            step = _definite_solve(gram, LEAST, gradient)  # nearly that of Gauss and Newton
            if len(step) and count * np.dot(step, gradient) < gains[1] * before:
                return point
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
def noise_model(w: FloatArray, order: int) -> FloatArray:
    """Return monic D of order ``order`` by least squares over w[order:]."""
    products = lag_products(w, order)
    matrix, right = np.zeros((order, order)), np.zeros(order)
    for i in range(order):
        right[i] = -products[0, i + 1]
        for j in range(i, order):
            matrix[i, j] = matrix[j, i] = products[i + 1, j + 1]
        matrix[i, i] = matrix[i, i] * (1.0 + 1e-10) + 1e-300
    out = np.zeros(order + 1)
    out[0] = 1.0
    solution = _definite_solve(matrix, 0.0, right)
    for i in range(len(solution)):
        out[1 + i] = solution[i]
    return out


@compiled
def cold_starts(problem: Problem, room: Room, order: int, p: int) -> tuple[Start, Start]:
    """Return the ARX model as it is, D = A, and refined for white noise, with D of what it leaves.

    Refined by the ARX model of data filtered by 1/A, repeated, of which the best is kept.
    """
    a, white, arx = np.zeros(order + 1), np.zeros(p + 1), np.zeros(0)
    a[0] = white[0] = 1.0
    for i in range(REFINEMENTS + 1):
        a = pulled_inside(arx_polynomial(problem, room, a), START_RADIUS)
        last = evaluate(problem, room, a, white, 0.0)
        if i == 0:
            arx, best = a, last
        elif last.energy < best.energy:
            best = last
    padded = np.zeros(p + 1)
    for i in range(min(order, p) + 1):
        padded[i] = arx[i]
    noise = noise_model(problem.y[problem.begin :] - best.free_run, p)
    return Start(arx, padded, 0.0), Start(best.a, noise, 0.0)
