r"""Free-run fit of one output with autoregressive noise.

.. math:: y_k = \frac{1}{A(q)} \Big[\sum_j B_j(q) \chi^{(j)}_k + c\Big] + w_k,
          \qquad D(q) w_k = \epsilon_k

A, B and D as in (8a), (8b); D is monic of order p. Noise added to PV is D = 1, noise inside the
ARX equation (9) is D = A, so both placements lie in the model. Everything linear (B, c and n_a
terms of the unknown initial state) is eliminated; Gauss-Newton runs over A and D only.

A noise model with a root near one makes the level of the free run invisible. So the criterion
is n log(Σε²/n) + n κ Σw²/Σy² with a small κ: where the free run is good it changes nothing.
"""

import dataclasses
import functools
import math

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.kernels.descent import Start, cold_starts, descend
from stiction_ros.identification.kernels.output_error import (
    FREE_RUN_WEIGHT,
    THIN,
    Point,
    Problem,
    Room,
)
from stiction_ros.identification.kernels.row import averaged

ROUGH = (0.3, 0.0)  # least gain of an iteration and least promised one
FINE = (1e-3, 1e-4)


@dataclasses.dataclass(frozen=True)
class Orders:
    """Orders and the common window of one identification."""

    output: int  # n_a
    input: int  # n_b
    noise: int  # p, order of D
    first: int  # first sample k_0 of the criterion, the same for all rivals


@dataclasses.dataclass(frozen=True)
class OutputFit:
    """A fitted output."""

    orders: Orders  # n_a, n_b, p, k_0
    delays: tuple[int, ...]  # t_d per valve, samples
    a: FloatArray  # monic polynomial A, shape (n_a + 1,)
    b: FloatArray  # shape (m, n_b)
    constant: float  # c
    noise: FloatArray  # monic polynomial D, shape (p + 1,)
    loss: float  # the criterion, n log(Σε²/n) + n κ Σw²/Σy²
    energy: float  # sum of squared innovations
    count: int  # n, number of innovations
    free_run: FloatArray  # simulated output from sample k_0 − p on
    innovations: FloatArray  # from sample k_0 on, shape (n,)

    @property
    def parameters(self) -> int:
        """Number of free parameters of the linear part and its noise."""
        return self.orders.output + self.b.size + 1 + self.orders.noise

    @property
    def bic(self) -> float:
        """Return n log(mean squared innovation) + parameters · log n."""
        return self.loss + self.parameters * float(np.log(self.count))


@functools.cache
def _difference_table(count: int) -> FloatArray:
    """Return T with differences = T · lags, shape (count, count)."""
    table = np.zeros((count, count))
    for i in range(count):
        for j in range(i + 1):
            table[i, j] = (-1.0) ** j * math.comb(i, j)
    return table


def pose(y: FloatArray, stems: FloatArray, delays: tuple[int, ...], orders: Orders) -> Problem:
    """Return the problem of one output.

    Neighbouring lags of a slow signal are almost parallel, so each is replaced by its
    differences: the same space, well conditioned, which allows normal equations. The unknown
    initial state adds n_a lags of an impulse through 1/A; with them, a constant in the
    equation is a constant in the free run.

    Args:
        y: shape (N,).
        stems: shape (m, N).
        delays: t_d per valve, samples.
        orders: n_a, n_b, p and the window.
    """
    valves, samples = stems.shape
    order, p, first = orders.output, orders.noise, orders.first
    begin, lags = first - p, np.array(delays) + 1
    pad = int(lags.max()) + orders.input + order + p + 1
    signals = np.zeros((valves + 2, pad + samples))
    signals[:valves, pad:] = stems
    signals[valves, pad + begin - order + 1] = 1.0
    signals[valves + 1, pad:] = y
    y = signals[valves + 1, pad:]
    energy = max(float(y[first:] @ y[first:]), 1e-300)
    return Problem(y, signals, lags, orders.input, pad, begin, first, energy)


def room_for(problem: Problem, orders: Orders) -> Room:
    """Return room for the evaluations of a problem, one at a time."""
    valves, free, order = len(problem.lags), len(problem.y) - problem.begin, orders.output
    count = len(problem.y) - problem.first
    size, priced = valves * orders.input + 1 + order, orders.noise + (count + THIN - 1) // THIN
    return Room(
        driven=np.zeros(problem.signals.shape),
        plain=np.ones((size, free)),
        rows=np.zeros((size + 1 + order + orders.noise, count + priced)),
        slope=np.zeros((2, problem.pad + free)),
        slopes=np.zeros((order, free)),
        moved=np.zeros(problem.signals.shape[1]),
        tables=(_difference_table(orders.input), _difference_table(order)),
    )


def loss_of(problem: Problem, point: Point) -> float:
    """Return n log(Σε²/n) + n κ Σw²/Σy²."""
    count, w = len(problem.y) - problem.first, problem.y[problem.begin :] - point.free_run
    penalty = FREE_RUN_WEIGHT * float(w @ w) / problem.energy
    return count * (math.log(max(point.energy, 1e-300) / count) + penalty)


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
    problem = pose(y, stems, delays, orders)
    room = room_for(problem, orders)
    # The starts are told apart by a rough descent; the best goes on to the end, with Σw²
    # priced anew by the innovations of a good model.
    if start is not None:
        starts: tuple[Start, ...] = (Start(start.a, start.noise, 0.0),)
    else:
        starts = cold_starts(problem, room, orders.output, orders.noise)
    rough = [descend(problem, room, one, max_iterations, ROUGH) for one in starts]
    best = min(rough, key=lambda point: loss_of(problem, point))
    again = Start(best.a, best.noise, best.energy)
    point = descend(problem, room, again, max_iterations, FINE)
    return _finished(problem, (delays, orders), point)


def _finished(problem: Problem, given: tuple[tuple[int, ...], Orders], point: Point) -> OutputFit:
    delays, orders = given
    level = len(delays) * orders.input
    b = point.theta[:level].reshape(len(delays), orders.input)
    w = problem.y[problem.begin :] - point.free_run
    innovations = np.empty(len(w) - orders.noise)
    averaged(point.noise, w, orders.noise, len(innovations), innovations)
    return OutputFit(
        orders=orders,
        delays=delays,
        a=point.a,
        b=b @ _difference_table(orders.input),
        constant=float(point.theta[level] * point.a.sum()),
        noise=point.noise,
        loss=loss_of(problem, point),
        energy=max(float(innovations @ innovations), 1e-300),
        count=len(innovations),
        free_run=point.free_run,
        innovations=innovations,
    )
