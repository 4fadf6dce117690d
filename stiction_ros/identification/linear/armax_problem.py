r"""One-step error of an ARMAX equation, with everything linear eliminated.

.. math:: e_k = \frac{1}{C(q)} \Big[ A(q) y_k - \sum_j B_j(q) \chi^{(j)}_k - c \Big]

A and B as in (8a), (8b); C is monic with all roots inside the unit circle. For a given C the
error is linear in A, B, c and in the n_c unknown errors before the first sample, so only C is
searched (variable projection). Where the best A is unstable, A is searched as well and kept
inside the unit circle.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.deferred import lfilter
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals import polynomials
from stiction_ros.signals.arx import arx_columns
from stiction_ros.signals.polynomials import largest_root

MAX_RADIUS = 0.9995
INSIDE = 0.98
"""Largest |root| of a searched A or C."""


@dataclasses.dataclass(frozen=True)
class ArmaxOrders:
    """Orders of one equation.

    Attributes:
        output: n_a ≥ 1.
        input: n_b ≥ 1, the same for every valve.
        noise: n_c; 0 makes it ARX.
    """

    output: int
    input: int
    noise: int


@dataclasses.dataclass(frozen=True)
class Point:
    """The least-squares solution at one C (and A, where it is searched).

    Attributes:
        a, c: monic polynomials, shapes (n_a + 1,), (n_c + 1,).
        b: shape (m, n_b).
        constant: c of the equation.
        residual: e from the first sample on, shape (n,).
        basis: orthonormal columns of all that was eliminated, shape (n, q).
        searched: whether A was given, not eliminated.
    """

    a: FloatArray
    c: FloatArray
    b: FloatArray
    constant: float
    residual: FloatArray
    basis: FloatArray
    searched: bool

    @property
    def energy(self) -> float:
        """Sum of squared errors."""
        return float(self.residual @ self.residual)


class Problem:
    """One output with its inputs, delays and orders on the samples from ``first`` on."""

    def __init__(
        self,
        y: FloatArray,
        u: FloatArray,
        delays: tuple[int, ...],
        orders: ArmaxOrders,
        first: int,
    ) -> None:
        """Prepare for y (N,), u (m, N); ``first`` ≥ n_a and ≥ every delay + n_b."""
        self.orders, self.valves = orders, len(u)
        count = len(y)
        self.target = y[first:]
        columns = arx_columns(-y, u, delays, (orders.output, orders.input), first)
        self.lagged_y = np.array(columns[: orders.output])
        self.others = np.vstack([*columns[orders.output :], np.ones(count - first)])
        self.starts = np.zeros((orders.noise, count - first))
        self.starts[np.arange(orders.noise), np.arange(orders.noise)] = 1.0

    def evaluate(self, c: FloatArray, a: FloatArray | None = None) -> Point:
        """Return the best equation for C = ``c``; A is eliminated too unless given."""
        orders, na = self.orders, self.orders.output
        rows, target, searched = [self.others, self.starts], self.target, a is not None
        if a is None:
            rows.insert(0, self.lagged_y)
        else:
            target = target - a[1:] @ self.lagged_y
        filtered = lfilter([1.0], c, np.vstack([*rows, target]), axis=1)
        columns, right = filtered[:-1].T, filtered[-1]
        scale = np.sqrt(np.einsum("ij,ij->j", columns, columns)) + 1e-300
        left, values, other = np.linalg.svd(columns / scale, full_matrices=False)
        keep = values > 1e-10 * values[0]
        basis = left[:, keep]
        inner = basis.T @ right
        theta = other[keep].T @ (inner / values[keep]) / scale
        if a is None:
            a, theta = np.concatenate([[1.0], theta[:na]]), theta[na:]
        size = self.valves * orders.input
        return Point(
            a,
            c,
            theta[:size].reshape(self.valves, orders.input),
            float(theta[size]),
            right - basis @ inner,
            basis,
            searched,
        )

    def slope(self, point: Point) -> FloatArray:
        """Return d(residual) by the searched coefficients, the eliminated part projected out."""
        count = len(self.target)
        rows = []
        if point.searched:
            rows += list(lfilter([1.0], point.c, -self.lagged_y, axis=1))
        echo = lfilter([1.0], point.c, -point.residual)
        for i in range(1, self.orders.noise + 1):
            rows.append(np.concatenate([np.zeros(i), echo[: count - i]]))
        jacobian = np.array(rows).reshape(len(rows), count).T
        return np.asarray(jacobian - point.basis @ (point.basis.T @ jacobian))


def stabilised(polynomial: FloatArray) -> FloatArray:
    """Return the polynomial with roots outside ``INSIDE`` moved onto it, angles kept."""
    return polynomials.stabilised(polynomial, INSIDE)


def descend(problem: Problem, point: Point, max_iterations: int = 60) -> tuple[Point, bool]:
    """Levenberg-Marquardt from ``point``, roots kept inside; return the end and if it converged.

    The error's slope is y_{k−i}/C by a_i and −e_{k−i}/C by c_i.
    """
    damping, na = 1e-3, problem.orders.output if point.searched else 0
    for _ in range(max_iterations):
        jacobian = problem.slope(point)
        if jacobian.shape[1] == 0:
            return point, True
        scale = np.sqrt(np.einsum("ij,ij->j", jacobian, jacobian)) + 1e-300
        jacobian = jacobian / scale
        gram, gradient = jacobian.T @ jacobian, jacobian.T @ point.residual
        candidate: Point | None = None
        while damping < 1e8:
            step = -np.linalg.solve(gram + damping * np.eye(len(gram)), gradient) / scale
            candidate = _moved(problem, point, step, na)
            if candidate is not None and candidate.energy < point.energy:
                break
            candidate = None
            damping *= 5.0
        if candidate is None:
            return point, True
        gain = 1.0 - candidate.energy / max(point.energy, 1e-300)
        point, damping = candidate, max(damping / 10.0, 1e-9)
        if gain * len(point.residual) < 1e-4:
            return point, True
    return point, False


def _moved(problem: Problem, point: Point, step: FloatArray, na: int) -> Point | None:
    """Return the point one step on; None where a root would leave the unit circle."""
    c = point.c + np.concatenate([[0.0], step[na:]])
    if largest_root(c) >= MAX_RADIUS:
        return None
    if not point.searched:
        return problem.evaluate(c)
    a = point.a + np.concatenate([[0.0], step[:na]])
    return problem.evaluate(c, a) if largest_root(a) < MAX_RADIUS else None
