r"""The programme (12) in the frictions alone, solved by IPOPT with slopes over a width.

.. math::
    \min_{f} V(f) \quad \text{s.t.} \quad f_S \ge f_D, \quad
    0 \le f_S, f_D \le \Delta u, \quad \sigma^2(\hat\chi) \ge \alpha \, \sigma^2(u)

V is piecewise constant in f_S at τ = 10⁴, so IPOPT is given the slope of V averaged over a width
that shrinks. The best point that was evaluated is the answer.
"""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.search_log import SolvedStart, pairs
from stiction_ros.paper.smoothed_laws import final_smoothing, smooth_law
from stiction_ros.records import Record
from stiction_ros.signals.arx import lagged
from stiction_ros.signals.arx_fit import ArxOrders, Delays

RIDGE = 1e-11  # on normal equations of unit columns: a stem that rests has no effect
KEPT = 4096  # stems that are kept for the other choices of delays
ALPHA = 0.1
MAX_ITERATIONS = 60
SHRINK = 0.92  # of the width, from one gradient to the next
NARROWEST = 0.005  # of f_max
FEASIBILITY = 1e-9
IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "hessian_approximation": "limited-memory",
    # V is about 1 at the start and f_max is 1: a first step of some hundredths.
    "limited_memory_initialization": "constant",
    "limited_memory_init_val": 100.0,
    "max_iter": MAX_ITERATIONS,
    "tol": 1e-4,
    "mu_init": 1e-6,
    "nlp_scaling_method": "none",
    "bound_push": 1e-8,
    "bound_frac": 1e-8,
    "slack_bound_push": 1e-8,
    "slack_bound_frac": 1e-8,
    # Both would let a step go through that raises V.
    "watchdog_shortened_iter_trigger": 0,
    "max_soft_resto_iters": 0,
}


class StemTable:
    """Stems of one record by friction, kept for all choices of delays.

    Attributes:
        record: what was measured.
        limits: f_max per valve, shape (m,), %.
        orders: n_a, n_b, ε.
        law: of the valves.
    """

    def __init__(
        self, record: Record, limits: FloatArray, orders: ArxOrders, law: str = "he"
    ) -> None:
        self.record, self.limits, self.orders = record, limits, orders
        self.law = smooth_law(law)
        self._smoothing = final_smoothing(limits)
        self._kept: dict[bytes, FloatArray] = {}

    def stems(self, friction: FloatArray) -> FloatArray:
        """Return the stems of frictions of shape (m, 2), shape (m, N), %."""
        key = np.round(friction, 9).tobytes()
        found = self._kept.get(key)
        if found is None:
            if len(self._kept) >= KEPT:
                self._kept.clear()
            found = self.law.stems(self.record.op, friction, self._smoothing)
            self._kept[key] = found
        return found


class Criterion:
    r"""V(f) for one choice of delays, and the share of (12f).

    .. math:: V(f) = \min_\theta \frac1p \sum_i \mathrm{SE}^{(i)}(f, \theta)

    is (12a), linear least squares in θ. Past outputs and the constant are projected out once.

    Attributes:
        table: stems of the record.
        delays: for each output the t_d of each valve, samples.
        evaluations: different frictions that were evaluated.
    """

    def __init__(self, table: StemTable, delays: Delays) -> None:
        self.table, self.delays = table, delays
        self.evaluations = 0
        self._kept: dict[bytes, tuple[float, FloatArray]] = {}
        orders, count = table.orders, len(table.record)
        self._past, self._rest = [], []
        for i, y in enumerate(table.record.pv.T):
            y = y - y.mean()
            past = orders.of_output(i, len(table.limits))[0]
            columns = lagged(-y, range(1, past + 1), orders.first)
            whole = np.column_stack([*columns, np.ones(count - orders.first)])
            basis = np.linalg.qr(whole)[0]
            target = y[orders.first :]
            self._past.append(basis)
            self._rest.append(target - basis @ (basis.T @ target))
        self._variance = np.maximum(table.record.op.var(axis=0), 1e-300)

    def __call__(self, friction: FloatArray) -> tuple[float, FloatArray]:
        """Return V, squared engineering units, and σ²(χ) / σ²(u) per valve, shape (m,)."""
        key = np.round(friction, 9).tobytes()
        if key not in self._kept:
            if len(self._kept) >= KEPT:
                self._kept.clear()
            self.evaluations += 1
            stems = self.table.stems(friction)
            errors = [self._error(i, stems) for i in range(len(self.delays))]
            self._kept[key] = float(np.mean(errors)), stems.var(axis=1) / self._variance
        return self._kept[key]

    def _error(self, output: int, stems: FloatArray) -> float:
        """Return SE (14) of one output with its best coefficients."""
        orders, delays, columns = self.table.orders, self.delays[output], []
        inputs = orders.of_output(output, len(stems))[1]
        for stem, delay, width in zip(stems - stems[:, :1], delays, inputs, strict=True):
            columns += lagged(stem, range(delay + 1, delay + width + 1), orders.first)
        phi, basis, rest = np.column_stack(columns), self._past[output], self._rest[output]
        phi = phi - basis @ (basis.T @ phi)
        norm = np.sqrt(np.einsum("ij,ij->j", phi, phi))
        phi = phi / np.maximum(norm, 1e-9)
        gram, right = phi.T @ phi, phi.T @ rest
        theta = np.linalg.solve(gram + RIDGE * np.eye(len(gram)), right)
        return float(rest @ rest - 2.0 * theta @ right + theta @ gram @ theta)


class ReducedProgramme:
    """The programme for one choice of delays; one solver serves every start."""

    def __init__(self, criterion: Criterion) -> None:
        self.criterion = criterion
        self.limits = criterion.table.limits
        self._size = 2 * len(self.limits)
        self._scale, self._width = 1.0, 0.1
        self._best: tuple[float, FloatArray] | None = None
        self._callbacks: list[_Called] = []
        self._solver = self._build()

    def solve(self, friction: FloatArray, width: float) -> SolvedStart:
        """Run IPOPT once from rows (f_S, f_D), shape (m, 2), %; ``width`` is a share of f_max.

        The best feasible point that was evaluated is returned, or the start where none was.
        """
        static, dynamic = np.asarray(friction, dtype=float).T / self.limits
        x = np.column_stack([static - dynamic, static + dynamic]).ravel()
        self._scale, self._width, self._best = 1.0, width, None
        self._scale = max(self._value(x), 1e-300)
        high = np.tile([1.0, 2.0], len(self.limits))
        self._solver(x0=x, lbx=0.0, ubx=high, lbg=0.0, ubg=np.inf)
        stats = self._solver.stats()
        status, iterations = str(stats["return_status"]), int(stats["iter_count"])
        value, found = (float("inf"), friction) if self._best is None else self._best
        return SolvedStart(
            self.criterion.delays,
            pairs(friction),
            pairs(found),
            value,
            status,
            iterations,
            feasible=bool(np.isfinite(value)),
        )

    def _friction(self, x: FloatArray) -> FloatArray:
        """Return rows (f_S, f_D), shape (m, 2), %, of (J, S) of every valve over f_max."""
        jump, band = x.reshape(-1, 2).T
        static, dynamic = 0.5 * (band + jump), 0.5 * (band - jump)
        return np.column_stack([static, dynamic]) * self.limits[:, None]

    def _value(self, x: FloatArray) -> float:
        friction = self._friction(x)
        value, moving = self.criterion(friction)
        static, dynamic = friction.T / self.limits
        room = min((static - dynamic).min(), dynamic.min(), (1.0 - static).min())
        feasible = room >= -FEASIBILITY and bool((moving >= ALPHA).all())
        if feasible and (self._best is None or value < self._best[0]):
            dynamic = np.maximum(friction[:, 1], 0.0)
            static = np.maximum(friction[:, 0], dynamic)
            self._best = value, np.column_stack([static, dynamic])
        return value / self._scale

    def _slopes(self, x: FloatArray) -> FloatArray:
        """Return the difference quotients of V over the width at hand, then narrow it."""
        ends = self._ends(x)
        slopes = [(self._value(high) - self._value(low)) / gap for high, low, gap in ends]
        self._width = max(NARROWEST, SHRINK * self._width)
        return np.array(slopes)

    def _ends(self, x: FloatArray) -> list[tuple[FloatArray, FloatArray, float]]:
        ends = []
        for place in range(self._size):
            high, low = x.copy(), x.copy()
            high[place] = x[place] + self._width
            low[place] = max(0.0, x[place] - self._width)
            ends.append((high, low, float(high[place] - low[place])))
        return ends

    def _limits(self, x: FloatArray) -> FloatArray:
        """Return f_D, f_max − f_S (12d) and σ²(χ)/(α σ²(u)) − 1 (12f) per valve, shape (3m,)."""
        friction = self._friction(x)
        static, dynamic = friction.T / self.limits
        moving = self.criterion(friction)[1]
        return np.concatenate([dynamic, 1.0 - static, moving / ALPHA - 1.0])

    def _limit_slopes(self, x: FloatArray) -> FloatArray:
        """Return the quotients of :meth:`_limits`, shape (3m, 2m)."""
        columns = [
            (self._limits(high) - self._limits(low)) / gap for high, low, gap in self._ends(x)
        ]
        return np.stack(columns, axis=1)

    def _build(self) -> Any:
        n, rows = self._size, 3 * len(self.limits)
        x, p = ca.MX.sym("x", n), ca.MX.sym("p", 0)
        value = self._called(lambda at: np.atleast_2d(self._value(at)), (1, 1))
        slopes = self._called(lambda at: self._slopes(at)[:, None], (n, 1))
        limits = self._called(lambda at: self._limits(at)[:, None], (rows, 1))
        limit_slopes = self._called(self._limit_slopes, (rows, n))
        options: dict[str, Any] = {
            "print_time": False,
            "no_nlp_grad": True,
            "calc_f": False,
            "calc_g": False,
            "calc_lam_p": False,
            "grad_f": ca.Function(
                "grad_f", [x, p], [value(x), slopes(x)], ["x", "p"], ["f", "grad_f_x"]
            ),
            "jac_g": ca.Function(
                "jac_g", [x, p], [limits(x), limit_slopes(x)], ["x", "p"], ["g", "jac_g_x"]
            ),
            "ipopt": IPOPT,
        }
        problem = {"x": x, "p": p, "f": value(x), "g": limits(x)}
        return ca.nlpsol("reduced", "ipopt", problem, options)

    def _called(self, function: Callable[[FloatArray], FloatArray], shape: tuple[int, int]) -> Any:
        made = _Called(function, self._size, shape)
        self._callbacks.append(made)  # CasADi does not keep them
        return made


class _Called(ca.Callback):
    """A Python function of the scaled frictions as a CasADi function."""

    def __init__(
        self, function: Callable[[FloatArray], FloatArray], size: int, shape: tuple[int, int]
    ) -> None:
        ca.Callback.__init__(self)
        self._function, self._size, self._shape = function, size, shape
        self.construct("called", {"enable_fd": False})

    def get_n_in(self) -> int:
        return 1

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, place: int) -> Any:
        return ca.Sparsity.dense(self._size, 1)

    def get_sparsity_out(self, place: int) -> Any:
        return ca.Sparsity.dense(*self._shape)

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        return [ca.DM(self._function(np.array(arguments[0]).ravel()))]
