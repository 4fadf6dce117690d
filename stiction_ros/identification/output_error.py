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

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.descent_kernels import Start, cold_starts, descend
from stiction_ros.identification.output_error_kernels import (
    Point,
    Problem,
    Room,
    innovations_of,
    loss_of,
    pose,
)

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
    problem, room = pose(
        np.array(y, dtype=float),
        np.array(stems, dtype=float),
        np.array(delays) + 1,
        (orders.output, orders.input, orders.noise),
        orders.first,
    )
    # The starts are told apart by a rough descent; the best goes on to the end, with Σw²
    # priced anew by the innovations of a good model.
    starts: tuple[Start, ...]
    if start is not None:
        starts = (Start(start.a, start.noise, 0.0),)
    else:
        starts = cold_starts(problem, room, orders.output, orders.noise)
    rough = [descend(problem, room, one, max_iterations, ROUGH_GAIN) for one in starts]
    best = min(rough, key=lambda point: loss_of(problem, point))
    again = Start(best.a, best.noise, best.energy)
    point = descend(problem, room, again, max_iterations, FINE_GAIN)
    return _finished(problem, room, (delays, orders), point)


def _finished(
    problem: Problem, room: Room, given: tuple[tuple[int, ...], Orders], point: Point
) -> OutputFit:
    delays, orders = given
    level = len(delays) * orders.input
    return OutputFit(
        orders=orders,
        delays=delays,
        a=point.a,
        b=point.theta[:level].reshape(len(delays), orders.input) @ room.tables[0],
        constant=float(point.theta[level] * point.a.sum()),
        noise=point.noise,
        loss=loss_of(problem, point),
        energy=max(point.energy, 1e-300),
        count=len(problem.y) - problem.first,
        free_run=point.free_run,
        innovations=innovations_of(problem, point),
    )
