r"""Free-run fit of one output with autoregressive noise.

.. math:: y_k = \frac{1}{A(q)} \Big[\sum_j B_j(q) \chi^{(j)}_k + c\Big] + w_k,
          \qquad D(q) w_k = \epsilon_k

A, B and D as in (8a), (8b); D is monic of order p. Noise added to PV is D = 1, noise inside the
ARX equation (9) is D = A, so both placements lie in the model. Everything linear (B, c and n_a
terms of the unknown initial state) is eliminated; Gauss-Newton runs over A and D only.

A noise model with a root near one makes the level of the free run invisible. So the criterion
is n log(Σε²/n) + n κ Σw²/Σy² with a small κ: where the free run is good it changes nothing.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from functools import partial

import numpy as np
from scipy.linalg import lapack

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.output_error_kernels import (
    Point,
    Problem,
    arx_polynomial,
    descend,
    evaluate,
    is_stable,
    loss_of,
)
from stiction_ros.identification.polynomials import stabilised
from stiction_ros.identification.side_by_side import together

THIN = 4
START_RADIUS = 0.99
ROUGH_GAIN = 0.3
FINE_GAIN = 1e-3


@dataclasses.dataclass(frozen=True)
class Orders:
    """Orders and the common window of one identification.

    Attributes:
        output: n_a.
        input: n_b.
        noise: p, order of D.
        first: first sample k_0 of the criterion, the same for all rivals.
    """

    output: int
    input: int
    noise: int
    first: int


@dataclasses.dataclass(frozen=True)
class OutputFit:
    """A fitted output.

    Attributes:
        orders: n_a, n_b, p, k_0.
        delays: t_d per valve, samples.
        a: monic polynomial A, shape (n_a + 1,).
        b: shape (m, n_b).
        constant: c.
        noise: monic polynomial D, shape (p + 1,).
        loss: the criterion, n log(Σε²/n) + n κ Σw²/Σy².
        energy: sum of squared innovations.
        count: n, number of innovations.
        free_run: simulated output from sample k_0 − p on.
        innovations: from sample k_0 on, shape (n,).
    """

    orders: Orders
    delays: tuple[int, ...]
    a: FloatArray
    b: FloatArray
    constant: float
    noise: FloatArray
    loss: float
    energy: float
    count: int
    free_run: FloatArray
    innovations: FloatArray

    @property
    def parameters(self) -> int:
        """Number of free parameters of the linear part and its noise."""
        return self.orders.output + self.b.size + 1 + self.orders.noise

    @property
    def bic(self) -> float:
        """Return n log(mean squared innovation) + parameters · log n."""
        return self.loss + self.parameters * float(np.log(self.count))


def _equation_error_start(problem: Problem, a: FloatArray, order: int) -> FloatArray:
    """Return A of the least-squares ARX model of data filtered by 1/A, (15), made stable."""
    lags = -_difference_table(order).T @ arx_polynomial(problem, a, order)
    a = np.concatenate([[1.0], lags])
    return a if is_stable(a, START_RADIUS) else stabilised(a, START_RADIUS)


def _problem(y: FloatArray, stems: FloatArray, delays: tuple[int, ...], orders: Orders) -> Problem:
    """Return the problem of one output.

    The linear columns are lagged signals. Neighbouring lags of a slow signal are almost
    parallel, so each is replaced by its differences: the same space, well conditioned, which
    allows normal equations.
    """
    count, valves = len(y), len(stems)
    begin = orders.first - orders.noise
    signals = np.zeros((valves + 2, count))
    signals[:valves] = stems
    signals[valves] = 1.0
    signals[valves + 1, begin - orders.output + 1] = 1.0
    groups = [(j, delay + 1, orders.input) for j, delay in enumerate(delays)]
    groups += [(valves, 0, 1), (valves + 1, 0, orders.output)]
    # Σw² is priced at all samples before the first innovation, as nothing else holds the
    # initial state there, then at every THIN-th.
    priced = np.r_[: orders.noise, orders.noise : count - begin : THIN]
    prices = np.sqrt(np.where(priced < orders.noise, 1.0, float(THIN)))
    return Problem(
        np.ascontiguousarray(y), signals, np.array(groups), begin, orders.first, priced, prices
    )


def _coefficients(problem: Problem, theta: FloatArray) -> FloatArray:
    """Return the coefficients of the lagged signals from those of their differences."""
    out = np.zeros(len(theta))
    row = 0
    for count in problem.groups[:, 2].tolist():
        out[row : row + count] = _difference_table(count).T @ theta[row : row + count]
        row += count
    return out


def _innovations(problem: Problem, point: Point) -> FloatArray:
    return point.residual[: len(problem.y) - problem.first]


@functools.cache
def _difference_table(count: int) -> FloatArray:
    """Return T with differences = T · lags, shape (count, count)."""
    table = np.zeros((count, count))
    for i in range(count):
        for j in range(i + 1):
            table[i, j] = (-1.0) ** j * math.comb(i, j)
    return table


def ar_fit(w: FloatArray, order: int) -> FloatArray:
    """Return monic D of order ``order`` by least squares over w[order:]."""
    if order == 0:
        return np.ones(1)
    columns = np.stack([w[order - i : len(w) - i] for i in range(1, order + 1)], axis=1)
    gram = columns.T @ columns
    gram[np.diag_indices(order)] *= 1.0 + 1e-10
    gram[np.diag_indices(order)] += 1e-300
    _, solution, info = lapack.dposv(gram, columns.T @ w[order:])
    if info != 0:
        return np.concatenate([[1.0], np.zeros(order)])
    return np.concatenate([[1.0], -solution])


def fit_output(
    y: FloatArray,
    stems: FloatArray,
    delays: tuple[int, ...],
    orders: Orders,
    start: OutputFit | None = None,
    max_iterations: int = 40,
) -> OutputFit:
    """Fit one output in free run with AR noise.

    Args:
        y: output about its mean, shape (N,).
        stems: stem positions about their operating point, shape (m, N).
        delays: t_d per valve, samples.
        orders: n_a, n_b, p and the window.
        start: a neighbouring fit of the same orders to start from; None starts from the ARX
            model with both noise placements and keeps the better.
    """
    problem = _problem(y, stems, delays, orders)
    table = _difference_table(orders.output)
    if start is not None:
        starts = [evaluate(problem, start.a, start.noise, 0.0)]
    else:
        a = _equation_error_start(problem, np.ones(1), orders.output)
        padded = np.zeros(orders.noise + 1)
        short = min(len(a), len(padded))
        padded[:short] = a[:short]
        white = evaluate(problem, a, np.eye(1, orders.noise + 1)[0], 0.0)
        refined = _steiglitz_mcbride(problem, white)
        noise = ar_fit(y[problem.begin :] - refined.free_run, orders.noise)
        starts = [evaluate(problem, a, padded, 0.0), evaluate(problem, refined.a, noise, 0.0)]
    # The starts are told apart by a rough descent; the best goes on to the end, with Σw²
    # priced anew by the innovations of a good model.
    rough = together(
        *(partial(descend, problem, point, table, max_iterations, ROUGH_GAIN) for point in starts)
    )
    best = min(rough, key=lambda point: loss_of(problem, point))
    return _finished(
        problem, delays, orders, descend(problem, best, table, max_iterations, FINE_GAIN)
    )


def _steiglitz_mcbride(problem: Problem, point: Point, iterations: int = 4) -> Point:
    """Return a better white-noise start: ARX of data filtered by 1/A, repeated."""
    best, energy = point, float(point.residual @ point.residual)
    for _ in range(iterations):
        a = _equation_error_start(problem, point.a, len(point.a) - 1)
        point = evaluate(problem, a, point.noise, 0.0)
        reached = float(point.residual @ point.residual)
        if reached < energy:
            best, energy = point, reached
    return best


def _finished(problem: Problem, delays: tuple[int, ...], orders: Orders, point: Point) -> OutputFit:
    valves = len(delays)
    theta = _coefficients(problem, point.theta)
    innovations = _innovations(problem, point)
    return OutputFit(
        orders=orders,
        delays=delays,
        a=point.a,
        b=theta[: valves * orders.input].reshape(valves, orders.input),
        constant=float(theta[valves * orders.input]),
        noise=point.noise,
        loss=loss_of(problem, point),
        energy=max(float(innovations @ innovations), 1e-300),
        count=len(innovations),
        free_run=point.free_run,
        innovations=innovations,
    )
