r"""The paper's nonlinear programme (12) for one choice of delays, as printed.

.. math::
    \min_{f_S, f_D, \theta} \ \frac1p \sum_i \mathrm{SE}^{(i)} \quad (12a) \qquad
    \text{s.t.} \quad 0 \le f_D \le f_S \le \Delta u \ (12d), (12e), \quad
    \sigma^2(\hat\chi) \ge \alpha \, \sigma^2(u) \ (12f)

with the stem of the smoothed law (12b) and the ARX prediction (12c). Single shooting: the
unknowns are 2m frictions and, per output, n_a + m n_b coefficients and a constant. CasADi derives
the gradients and the exact Hessian.
"""

import functools
from typing import Any

import casadi as ca
import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.one_step_result import EquationError, fit_outputs
from stiction_ros.paper.programme.reduced_programme import ALPHA
from stiction_ros.paper.search_log import SolvedStart, pairs
from stiction_ros.paper.smoothed_laws import SmoothLaw, smooth_law
from stiction_ros.records import Record
from stiction_ros.signals.arx_fit import ArxFit, ArxOrders, Delays, regressors, stable_arx

FEASIBILITY = 1e-6
IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "max_iter": 60,
    "tol": 1e-5,
    "acceptable_tol": 1e-3,
    "acceptable_iter": 4,
    "mu_init": 1e-4,
    # Starts lie on the border of the triangle, and stay there.
    "bound_push": 1e-8,
    "bound_frac": 1e-8,
    "slack_bound_push": 1e-8,
    "slack_bound_frac": 1e-8,
}


class FrictionProgramme:
    """Problem (12) for given delays; one solver serves every start.

    OP and PV are taken about their means. Coefficients beyond the orders of their channel are held
    at 0.
    """

    def __init__(
        self, record: Record, limits: FloatArray, orders: ArxOrders, delays: Delays, law: str = "he"
    ) -> None:
        """Build for f_max = Δu of every valve, ``limits`` (m,), %."""
        self.orders, self.delays, self.law = orders, delays, smooth_law(law)
        self._op, self._pv = (part - part.mean(axis=0) for part in (record.op, record.pv))
        self._valves = len(limits)
        kept = [np.append(orders.kept(i, len(limits)), True) for i in range(len(delays))]
        free = np.where(np.concatenate(kept), np.inf, 0.0)
        self._low = np.concatenate([np.zeros(2 * len(limits)), -free])
        self._high = np.concatenate([np.repeat(limits, 2), free])
        fits = [
            stable_arx(y, self._op.T, row, orders, mask[:-1])
            for y, row, mask in zip(self._pv.T, delays, kept, strict=True)
        ]
        self._first = np.concatenate([_coefficients(fit) for fit in fits])
        self._solver = self._built()

    def fitted(
        self, friction: FloatArray, smoothing: FloatArray
    ) -> tuple[FloatArray, EquationError]:
        """Return unknowns with the least-squares coefficients of these frictions, and their fits.

        The frictions are rows (f_S, f_D), shape (m, 2), %; τ is one a valve, 1/%.
        """
        stems = self.law.stems(self._op, friction, smoothing)
        found = fit_outputs(self._pv, stems, self.delays, self.orders)
        return np.concatenate([friction.ravel(), *map(_coefficients, found.fits)]), found

    def solve(
        self, start: FloatArray, smoothing: FloatArray, x: FloatArray | None = None
    ) -> SolvedStart:
        """Run IPOPT once from frictions, then solve the coefficients with the frictions held.

        The unknowns ``x`` are those frictions and the ARX start (15) unless given.
        """
        begun = np.concatenate([start.ravel(), self._first]) if x is None else x
        bounds = {"lbx": self._low, "ubx": self._high, "lbg": 0.0, "ubg": np.inf}
        answer, stats = self._solver(x0=begun, p=smoothing, **bounds), self._solver.stats()
        end, slack = np.array(answer["x"]).ravel(), np.array(answer["g"]).ravel()
        friction = end[: 2 * self._valves].reshape(-1, 2)
        objective, stable = float(answer["f"]), False
        if np.isfinite(end).all():
            found = self.fitted(friction, smoothing)[1]
            objective = float(np.fmin(objective, found.squared_error))
            stable = max(fit.largest_root for fit in found.fits) < 1.0
        finite = bool(np.isfinite(end).all() and np.isfinite(slack).all())
        return SolvedStart(
            delays=self.delays,
            start=pairs(start),
            end=pairs(friction),
            objective=objective,
            status=str(stats["return_status"]),
            iterations=int(stats["iter_count"]),
            feasible=finite and bool(slack.min(initial=0.0) >= -FEASIBILITY),
            stable=finite and stable,
        )

    def _built(self) -> Any:
        """Return the solver: (12a) subject to f_S − f_D (12e), σ²(χ)/(α σ²(u)) − 1 (12f) ≥ 0."""
        count, m = self._op.shape
        x, tau = ca.MX.sym("x", len(self._low)), ca.MX.sym("tau", m)
        stem = smoothed_stem(count, self.law)
        stems = [stem(op, x[2 * j : 2 * j + 2], tau[j]).T for j, op in enumerate(self._op.T)]
        width = len(self._first) // len(self.delays)
        theta = [x[2 * m + i * width :][:width] for i in range(len(self.delays))]
        errors = [ca.sumsqr(self._residual(i, own, stems)) for i, own in enumerate(theta)]
        ordered = [x[2 * j] - x[2 * j + 1] for j in range(m)]
        moving = [
            ca.sumsqr(one - ca.sum2(one) / count) / (ALPHA * float(op.var()) * count) - 1.0
            for one, op in zip(stems, self._op.T, strict=True)
        ]
        objective, limits = sum(errors) / len(errors), ca.vertcat(*ordered, *moving)
        problem = {"x": x, "p": tau, "f": objective, "g": limits}
        options: dict[str, Any] = {"print_time": False, "calc_lam_p": False, "ipopt": IPOPT}
        return ca.nlpsol("friction", "ipopt", problem, options)

    def _residual(self, i: int, theta: Any, stems: list[Any]) -> Any:
        """Return the error of the prediction (12c) of output i, shape (1, N − ε)."""
        orders, count, y = self.orders, len(self._pv), self._pv[:, i]
        past = regressors(y, self._op.T, self.delays[i], orders)[:, : orders.output]
        lagged = [
            stem[:, orders.first - delay - lag : count - delay - lag]
            for stem, delay in zip(stems, self.delays[i], strict=True)
            for lag in range(1, orders.input + 1)
        ]
        ones = ca.DM.ones(1, count - orders.first)
        phi = ca.vertcat(ca.DM(past.T), *lagged, ones)
        return ca.mtimes(theta.T, phi) - ca.DM(y[None, orders.first :])


@functools.lru_cache(maxsize=1)
def smoothed_stem(samples: int, law: SmoothLaw) -> Any:
    """Return the CasADi function of OP, shape (N,), (f_S, f_D) and τ that gives the stem, (N,)."""
    symbols: Any = ca.SX.sym
    state, pair = symbols("s", law.states), symbols("u", 2)
    friction, smoothing = symbols("f", 2), symbols("tau")
    figures = ca.vertcat(friction, smoothing)
    entries, ends, told = (tuple(ca.vertsplit(each)) for each in (state, pair, figures))
    following = ca.vertcat(*law.step(entries, ends, told, ca.tanh))
    sample = ca.Function("sample", [state, pair, figures], [following], {"cse": True})
    op = symbols("op", samples)
    rest = ca.vertcat(op[0], np.zeros(law.states - 1))
    pairs_of = ca.horzcat(op, ca.vertcat(op[0], op[:-1])).T
    states = sample.mapaccum("states", samples)(rest, pairs_of, ca.repmat(figures, 1, samples))
    return ca.Function("stem", [op, friction, smoothing], [states[0, :].T])


def _coefficients(fit: ArxFit) -> FloatArray:
    """Return θ of one output, (a, b, c), shape (n_a + m n_b + 1,)."""
    return np.concatenate([fit.a, fit.b.ravel(), [fit.constant]])
