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

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack, solve_triangular
from scipy.signal import lfilter

from stiction_ros.effects.behaviour import FloatArray

MAX_RADIUS = 0.9995
FREE_RUN_WEIGHT = 0.02
THIN = 4


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
        converged: whether Gauss-Newton ended by its tolerance.
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
    converged: bool

    @property
    def parameters(self) -> int:
        """Number of free parameters of the linear part and its noise."""
        return self.orders.output + self.b.size + 1 + self.orders.noise

    @property
    def bic(self) -> float:
        """Return n log(mean squared innovation) + parameters · log n."""
        return self.loss + self.parameters * float(np.log(self.count))


def stabilised(a: FloatArray, radius: float = 0.99) -> FloatArray:
    """Return A with roots outside ``radius`` pulled back onto it."""
    roots = np.roots(a)
    size = np.abs(roots)
    if not len(roots) or size.max() <= radius:
        return a
    roots = np.where(size > radius, roots / np.maximum(size, 1e-12) * radius, roots)
    return np.real(np.poly(roots))


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
    """Evaluates residuals and their derivative for given A and D."""

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

    def columns(self, x: FloatArray) -> FloatArray:
        """Return all lagged linear columns from filtered signals; shape (N − begin, q)."""
        begin, end = self.begin, x.shape[1]
        lags = [(j, d + i) for j, d in enumerate(self.delays) for i in self._input_lags()]
        lags.append((-2, 0))
        lags += [(-1, i) for i in range(self.orders.output)]
        out = np.empty((end - begin, len(lags)), order="F")
        for position, (row, lag) in enumerate(lags):
            out[:, position] = x[row, begin - lag : end - lag]
        return out

    def _input_lags(self) -> range:
        return range(1, self.orders.input + 1)

    def evaluate(self, a: FloatArray, noise: FloatArray, weight: float = 0.0) -> _Point:
        """Return the variable-projection solution at (A, D).

        Args:
            weight: price of Σw², on every ``THIN``-th sample; 0 for innovations only.
        """
        factor = float(np.sqrt(THIN * weight))
        p = self.orders.noise
        plain = self.columns(lfilter([1.0], a, self.signals, axis=1))
        scale = np.sqrt(np.einsum("ij,ij->j", plain, plain)) + 1e-300
        plain /= scale
        whitened = lfilter(noise, [1.0], plain, axis=0)[p:]
        target = lfilter(noise, [1.0], self.y[self.begin :])[p:]
        count = len(target)
        if weight > 0.0:
            whitened = np.vstack([whitened, factor * plain[p::THIN]])
            target = np.concatenate([target, factor * self.y[self.begin + p :: THIN]])
        q, r = np.linalg.qr(whitened)
        diagonal = np.abs(np.diag(r))
        keep = diagonal > 1e-9 * max(float(diagonal.max()), 1e-300)
        if not keep.all():
            plain, scale = plain[:, keep], scale[keep]
            q, r = np.linalg.qr(whitened[:, keep])
        theta = solve_triangular(r, q.T @ target)
        residual = target - q @ (q.T @ target)
        return _Point(a, noise, theta / scale, keep, q, plain @ theta, residual, count, factor)


@dataclasses.dataclass(frozen=True)
class _Point:
    a: FloatArray
    noise: FloatArray
    theta: FloatArray
    keep: NDArray[np.bool_]
    q: FloatArray
    free_run: FloatArray
    residual: FloatArray
    count: int
    factor: float

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


def _jacobian(problem: _Problem, point: _Point) -> FloatArray:
    """Return d(residual)/d(a, d) with the linear part projected out; Kaufman's form."""
    orders, p = problem.orders, problem.orders.noise
    count = len(problem.y) - problem.begin
    # dŷ/da_i = −q^-i ŷ/A; what started before `begin` lies in the span of the initial terms.
    slope = lfilter([1.0], point.a, point.free_run)
    jacobian = np.zeros((len(point.residual), orders.output + p), order="F")
    for i in range(1, orders.output + 1):
        shifted = np.concatenate([np.zeros(i), slope[: count - i]])
        jacobian[: point.count, i - 1] = lfilter(point.noise, [1.0], shifted)[p:]
        if point.factor > 0.0:
            jacobian[point.count :, i - 1] = point.factor * shifted[p::THIN]
    w = problem.y[problem.begin :] - point.free_run
    for i in range(1, p + 1):
        jacobian[: point.count, orders.output + i - 1] = w[p - i : count - i]
    return np.asarray(jacobian - point.q @ (point.q.T @ jacobian))


def _descend(problem: _Problem, point: _Point, max_iterations: int) -> tuple[_Point, bool]:
    """Levenberg-Marquardt over (a, d) from ``point``, Σw² priced by its innovations."""
    na = problem.orders.output
    damping = 1e-3
    innovations = point.innovations
    weight = FREE_RUN_WEIGHT * float(innovations @ innovations) / problem.energy
    point = problem.evaluate(point.a, point.noise, weight)
    for _ in range(max_iterations):
        jacobian = _jacobian(problem, point)
        scale = np.sqrt(np.einsum("ij,ij->j", jacobian, jacobian)) + 1e-300
        jacobian /= scale
        gram, gradient = jacobian.T @ jacobian, jacobian.T @ point.residual
        improved = False
        while damping < 1e6:
            system = gram + damping * np.eye(len(gram))
            step = -np.linalg.solve(system, gradient) / scale
            a = point.a.copy()
            a[1:] += step[:na]
            noise = point.noise.copy()
            noise[1:] += step[na:]
            if np.abs(np.roots(a)).max(initial=0.0) < MAX_RADIUS:
                candidate = problem.evaluate(a, noise, weight)
                if candidate.energy < point.energy:
                    improved = True
                    break
            damping *= 5.0
        if not improved:
            return point, True
        gain = 1.0 - candidate.energy / point.energy
        point, damping = candidate, max(damping / 10.0, 1e-9)
        if gain * point.count < 1e-3:
            return point, True
    return point, False


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
    results = []
    for point in starts:
        # Twice: the second time Σw² is priced by the innovations of a good model.
        point, _ = _descend(problem, point, max_iterations)
        results.append(_finished(problem, *_descend(problem, point, max_iterations)))
    return min(results, key=lambda fit: fit.loss)


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


def _finished(problem: _Problem, point: _Point, converged: bool) -> OutputFit:
    orders, valves = problem.orders, len(problem.delays)
    theta = np.zeros(len(point.keep))
    theta[point.keep] = point.theta
    innovations = point.innovations
    count = point.count
    energy = max(float(innovations @ innovations), 1e-300)
    w = problem.y[problem.orders.first :] - point.free_run[problem.orders.noise :]
    penalty = FREE_RUN_WEIGHT * float(w @ w) / problem.energy
    return OutputFit(
        orders=orders,
        delays=problem.delays,
        a=point.a,
        b=theta[: valves * orders.input].reshape(valves, orders.input),
        constant=float(theta[valves * orders.input]),
        noise=point.noise,
        loss=count * (float(np.log(energy / count)) + penalty),
        energy=energy,
        count=count,
        free_run=point.free_run,
        innovations=innovations,
        converged=converged,
    )
