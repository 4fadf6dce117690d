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
from stiction_ros.identification.kernels.row import factor, lag_products, solved
from stiction_ros.signals.polynomials import is_stable, pulled_inside

MAX_RADIUS = 0.9995
START_RADIUS = 0.99
REFINEMENTS = 4  # of the start, as Steiglitz and McBride
FIRST, LEAST, HARDEST = 1e-4, 1e-9, 1e6  # damping
LOAD = 1e-10  # damping of a noise model


class Start(NamedTuple):
    """Where a descent starts."""

    a: FloatArray  # a, noise: monic polynomials A and D
    noise: FloatArray
    energy: float  # sum of squares of the innovations; 0 where it is not known


@compiled
def _damped_step(gram: FloatArray, gradient: FloatArray, damping: float) -> FloatArray:
    """Return the solution with a diagonal that is larger by a share ``damping``.

    A coefficient without influence stays where it is.
    """
    size, damped = len(gradient), gram.copy()
    for i in range(size):
        damped[i, i] *= 1.0 + damping
    root, kept, number = factor(damped, size)
    return solved(root, kept, number, gradient, size)


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
    gram, gradient = np.empty((0, 0)), np.empty(0)
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
            before = point.total
            step = _damped_step(gram, gradient, LEAST)  # nearly that of Gauss and Newton
            if count * np.dot(step, gradient) < gains[1] * before:
                return point
        else:
            damping *= 5.0
        if not damping < HARDEST:
            return point
        step = _damped_step(gram, gradient, damping)
        a, noise = point.a.copy(), point.noise.copy()
        for i in range(order):
            for j in range(order):
                a[1 + j] -= table[i, j] * step[i]
        for i in range(len(noise) - 1):
            noise[1 + i] -= step[order + i]


@compiled
def noise_model(w: FloatArray, order: int) -> FloatArray:
    """Return monic D of order ``order`` by least squares over w[order:]."""
    products = lag_products(w, order)
    out = np.ones(order + 1)
    step = _damped_step(products[1:, 1:].T.copy(), products[0, 1:], LOAD)
    for i in range(order):
        out[1 + i] = -step[i]
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
