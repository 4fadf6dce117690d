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
import itertools
import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, lapack, solve_triangular
from scipy.signal import lfilter

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.polynomials import stabilised

MAX_RADIUS = 0.9995
FREE_RUN_WEIGHT = 0.02
THIN = 4
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


def equation_error_start(
    y: FloatArray, stems: FloatArray, delays: tuple[int, ...], orders: Orders
) -> FloatArray:
    """Return A of the least-squares ARX model, (15), made stable; shape (n_a + 1,)."""
    first, count = orders.first, len(y)
    columns = [-y[first - i : count - i] for i in range(1, orders.output + 1)]
    for stem, delay in zip(stems, delays, strict=True):
        columns += [stem[first - delay - i : count - delay - i] for i in range(1, orders.input + 1)]
    columns.append(np.ones(count - first))
    theta = np.linalg.lstsq(np.stack(columns, axis=1), y[first:], rcond=1e-10)[0]
    return stabilised(np.concatenate([[1.0], theta[: orders.output]]))


class _Problem:
    """Evaluates residuals and their derivative for given A and D.

    The linear columns are lagged signals. Neighbouring lags of a slow signal are almost
    parallel, so each is replaced by its differences: the same space, well conditioned, which
    allows normal equations.
    """

    def __init__(
        self, y: FloatArray, stems: FloatArray, delays: tuple[int, ...], orders: Orders
    ) -> None:
        self.y, self.orders, self.delays = y, orders, delays
        self.begin = orders.first - orders.noise
        self.energy = max(float(y[orders.first :] @ y[orders.first :]), 1e-300)
        self.signals = np.zeros((len(stems) + 2, len(y)))
        self.signals[: len(stems)] = stems
        self.signals[-2] = 1.0
        self.signals[-1, self.begin - orders.output + 1] = 1.0
        self.groups = [(j, delay + 1, orders.input) for j, delay in enumerate(delays)]
        self.groups += [(-2, 0, 1), (-1, 0, orders.output)]
        self.size = sum(count for _, _, count in self.groups)
        # Samples, from `begin` on, at which Σw² is priced: all before the first innovation, as
        # nothing else holds the initial state there, then every THIN-th.
        self.priced = np.r_[: orders.noise, orders.noise : len(y) - self.begin : THIN]
        self.prices = np.sqrt(np.where(self.priced < orders.noise, 1.0, float(THIN)))

    def rows(self, x: FloatArray, begin: int) -> FloatArray:
        """Return differences of the lagged signals from sample ``begin`` on; (q, N - begin)."""
        end = x.shape[1]
        out = np.empty((self.size, end - begin))
        row = 0
        for signal, lag, count in self.groups:
            lags = [x[signal, begin - lag - i : end - lag - i] for i in range(count)]
            for _ in range(count):
                out[row] = lags[0]
                lags = [now - before for now, before in itertools.pairwise(lags)]
                row += 1
        return out

    def coefficients(self, theta: FloatArray) -> FloatArray:
        """Return the coefficients of the lagged signals from those of their differences."""
        out = np.zeros(self.size)
        row = 0
        for _, _, count in self.groups:
            out[row : row + count] = _difference_table(count).T @ theta[row : row + count]
            row += count
        return out

    def evaluate(self, a: FloatArray, noise: FloatArray, weight: float = 0.0) -> _Point:
        """Return the variable-projection solution at (A, D).

        Args:
            weight: price of Σw²; 0 for innovations only.
        """
        first, begin = self.orders.first, self.begin
        prices = np.sqrt(weight) * self.prices
        plain = self.rows(lfilter([1.0], a, self.signals, axis=1), begin)
        rows = self.rows(lfilter(noise, a, self.signals, axis=1), first)
        target = lfilter(noise, [1.0], self.y[begin:])[first - begin :]
        count = len(target)
        if weight > 0.0:
            rows = np.hstack([rows, prices * plain[:, self.priced]])
            target = np.concatenate([target, prices * self.y[begin + self.priced]])
        theta, root, keep = _least_squares(rows, target)
        if not keep.all():
            rows = rows[keep]
        residual = target - theta[keep] @ rows
        return _Point(a, noise, theta, rows, root, theta @ plain, residual, count, weight)


def _least_squares(
    rows: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return theta (q,), the Cholesky factor of the kept rows' Gram matrix, and which are kept.

    Rows that depend on those before them are dropped; their theta is 0.
    """
    gram = rows @ rows.T
    right = rows @ target
    scale = np.sqrt(np.diag(gram)) + 1e-300
    keep = scale > 1e-12 * scale.max()
    while True:
        size = scale[keep]
        scaled = gram[np.ix_(keep, keep)] / np.outer(size, size)
        root, info = lapack.dpotrf(scaled, lower=1)
        bad = int(info) - 1
        if info == 0:
            small = np.flatnonzero(np.diag(root) < 1e-6)
            if not len(small):
                break
            bad = int(small[0])
        keep[np.flatnonzero(keep)[bad]] = False
    root *= size[:, None]
    theta = np.zeros(len(rows))
    theta[keep] = cho_solve((root, True), right[keep], check_finite=False)
    return theta, root, keep


@functools.cache
def _difference_table(count: int) -> FloatArray:
    """Return T with differences = T · lags, shape (count, count)."""
    table = np.zeros((count, count))
    for i in range(count):
        for j in range(i + 1):
            table[i, j] = (-1.0) ** j * math.comb(i, j)
    return table


@dataclasses.dataclass(frozen=True)
class _Point:
    a: FloatArray
    noise: FloatArray
    theta: FloatArray
    rows: FloatArray
    root: FloatArray
    free_run: FloatArray
    residual: FloatArray
    count: int
    weight: float

    @property
    def innovations(self) -> FloatArray:
        return self.residual[: self.count]

    @property
    def energy(self) -> float:
        return float(self.residual @ self.residual)


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


def _normal_equations(problem: _Problem, point: _Point) -> tuple[FloatArray, FloatArray]:
    """Return Gram matrix and gradient over (a, d) with the linear part projected out.

    Kaufman's form of the derivative of the variable projection. As with the linear columns,
    the lags of A are replaced by differences; :func:`_descend` turns its steps back.
    """
    orders, p = problem.orders, problem.orders.noise
    count = point.count
    # dŷ/da_i = −q^-i ŷ/A; what started before `begin` lies in the span of the initial terms.
    lead = np.zeros(orders.output)
    slope = np.concatenate([lead, lfilter(point.noise, point.a, point.free_run)])
    jacobian = np.empty((orders.output + p, len(point.residual)))
    for i in range(1, orders.output + 1):
        begin = orders.output + p - i
        jacobian[i - 1, :count] = slope[begin : begin + count]
    if point.weight > 0.0:
        plain = np.concatenate([lead, lfilter([1.0], point.a, point.free_run)])
        prices = np.sqrt(point.weight) * problem.prices
        for i in range(1, orders.output + 1):
            jacobian[i - 1, count:] = prices * plain[orders.output - i + problem.priced]
    w = problem.y[problem.begin :] - point.free_run
    for i in range(1, p + 1):
        jacobian[orders.output + i - 1, :count] = w[p - i : p - i + count]
        jacobian[orders.output + i - 1, count:] = 0.0
    jacobian[: orders.output] = _difference_table(orders.output) @ jacobian[: orders.output]
    cross = solve_triangular(point.root, point.rows @ jacobian.T, lower=True, check_finite=False)
    return jacobian @ jacobian.T - cross.T @ cross, jacobian @ point.residual


def _descend(problem: _Problem, point: _Point, max_iterations: int, least_gain: float) -> _Point:
    """Levenberg-Marquardt over (a, d) from ``point``, Σw² priced by its innovations.

    Ends when an iteration lowers the criterion by less than ``least_gain``.
    """
    na = problem.orders.output
    table = _difference_table(na)
    damping = 1e-4
    innovations = point.innovations
    weight = FREE_RUN_WEIGHT * float(innovations @ innovations) / problem.energy
    point = problem.evaluate(point.a, point.noise, weight)
    for _ in range(max_iterations):
        gram, gradient = _normal_equations(problem, point)
        scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
        scale[scale < 1e-100] = 1.0  # a coefficient without influence stays where it is
        gram /= np.outer(scale, scale)
        gradient /= scale
        improved = False
        while damping < 1e6:
            system = gram + damping * np.eye(len(gram))
            step = -np.linalg.solve(system, gradient) / scale
            a = point.a.copy()
            a[1:] += table.T @ step[:na]
            noise = point.noise.copy()
            noise[1:] += step[na:]
            if np.abs(np.roots(a)).max(initial=0.0) < MAX_RADIUS:
                candidate = problem.evaluate(a, noise, weight)
                if candidate.energy < point.energy:
                    improved = True
                    break
            damping *= 5.0
        if not improved:
            return point
        gain = 1.0 - candidate.energy / point.energy
        point, damping = candidate, max(damping / 10.0, 1e-9)
        if gain * point.count < least_gain and damping < 1e-5:
            break
    return point


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
    problem = _Problem(y, stems, delays, orders)
    if start is not None:
        starts = [problem.evaluate(start.a, start.noise)]
    else:
        a = equation_error_start(y, stems, delays, orders)
        padded = np.zeros(orders.noise + 1)
        short = min(len(a), len(padded))
        padded[:short] = a[:short]
        white = problem.evaluate(a, np.eye(1, orders.noise + 1)[0])
        refined = _steiglitz_mcbride(problem, white)
        noise = ar_fit(y[problem.begin :] - refined.free_run, orders.noise)
        starts = [problem.evaluate(a, padded), problem.evaluate(refined.a, noise)]
    # The starts are told apart by a rough descent; the best goes on to the end, with Σw²
    # priced anew by the innovations of a good model.
    rough = [_descend(problem, point, max_iterations, ROUGH_GAIN) for point in starts]
    best = min(rough, key=lambda point: _loss(problem, point))
    return _finished(problem, _descend(problem, best, max_iterations, FINE_GAIN))


def _steiglitz_mcbride(problem: _Problem, point: _Point, iterations: int = 4) -> _Point:
    """Return a better white-noise start: ARX of data filtered by 1/A, repeated."""
    best, orders, delays = point, problem.orders, problem.delays
    for _ in range(iterations):
        filtered = lfilter([1.0], point.a, np.vstack([problem.y, problem.signals[:-2]]), axis=1)
        a = equation_error_start(filtered[0], filtered[1:], delays, orders)
        point = problem.evaluate(a, point.noise)
        if point.energy < best.energy:
            best = point
    return best


def _loss(problem: _Problem, point: _Point) -> float:
    """Return n log(Σε²/n) + n κ Σw²/Σy²."""
    innovations = point.innovations
    energy = max(float(innovations @ innovations), 1e-300)
    w = problem.y[problem.begin :] - point.free_run
    penalty = FREE_RUN_WEIGHT * float(w @ w) / problem.energy
    return point.count * (float(np.log(energy / point.count)) + penalty)


def _finished(problem: _Problem, point: _Point) -> OutputFit:
    orders, valves = problem.orders, len(problem.delays)
    theta = problem.coefficients(point.theta)
    innovations = point.innovations
    return OutputFit(
        orders=orders,
        delays=problem.delays,
        a=point.a,
        b=theta[: valves * orders.input].reshape(valves, orders.input),
        constant=float(theta[valves * orders.input]),
        noise=point.noise,
        loss=_loss(problem, point),
        energy=max(float(innovations @ innovations), 1e-300),
        count=point.count,
        free_run=point.free_run,
        innovations=innovations,
    )
