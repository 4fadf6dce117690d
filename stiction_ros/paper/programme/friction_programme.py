r"""The paper's nonlinear programme (12) for one choice of delays.

.. math::
    \min_{f_S, f_D, \theta} \ \frac1p \sum_i \mathrm{SE}^{(i)} \quad (12a) \qquad
    \text{s.t.} \quad 0 \le f_D \le f_S \le \Delta u \ (12d), (12e), \quad
    \sigma^2(\hat\chi) \ge \alpha \, \sigma^2(u) \ (12f)

with the stem of the smoothed law (12b) and the ARX prediction (12c). Single shooting: the
unknowns are 2m frictions and, per output, n_a + m n_b coefficients and a constant.

OP is scaled by its span, the objective by its value at the ARX start (15)-(16), and the
coefficients by the triangular factor of the regressors at that start, so that the Hessian in
them begins near a multiple of the identity. The Hessian is exact.
"""

from typing import Any

import casadi as ca
import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.one_step_result import EquationError, fit_outputs
from stiction_ros.paper.programme.programme_data import Frame, ProgrammeData
from stiction_ros.paper.programme.reduced_programme import ALPHA
from stiction_ros.paper.search_log import SolvedStart, pairs
from stiction_ros.signals.arx_fit import Delays

FEASIBILITY = 1e-6
MAX_ITERATIONS = 60
IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-5,
    "acceptable_tol": 1e-3,
    "acceptable_iter": 4,
    "mu_init": 1e-4,
    # Data are scaled above; steep spots of the smoothed law must not scale the objective.
    "nlp_scaling_method": "none",
    "bound_push": 1e-8,
    "bound_frac": 1e-8,
    "slack_bound_push": 1e-8,
    "slack_bound_frac": 1e-8,
}


class FrictionProgramme:
    """Problem (12) for given delays; one solver serves every start."""

    def __init__(self, data: ProgrammeData, delays: Delays) -> None:
        self.data, self.delays, self.frame = data, delays, Frame.of(data, delays)
        self._solver = self._build_solver()

    def start(self, friction: FloatArray) -> FloatArray:
        """Return unknowns with these frictions, shape (m, 2), %, and the ARX start (15)."""
        x = np.zeros(self.frame.size)
        x[: 2 * self.frame.valves] = (friction / self.data.op_span[:, None]).ravel()
        return x

    def fitted(
        self, friction: FloatArray, smoothing: FloatArray
    ) -> tuple[FloatArray, EquationError]:
        """Return unknowns with the least-squares coefficients of these frictions, and their fits.

        The frictions are rows (f_S, f_D), shape (m, 2), %; τ is one a valve, 1/%.
        """
        span, data = self.data.op_span, self.data
        stems = data.law.stems(data.op.T, friction / span[:, None], smoothing * span)
        found = fit_outputs(data.pv.T, stems, self.delays, data.orders)
        x = self.start(friction)
        for i, fit in enumerate(found.fits):
            theta = np.concatenate([fit.a, fit.b.ravel(), [fit.constant]])
            place = 2 * self.frame.valves + i * self.frame.width
            free = np.flatnonzero(np.append(data.orders.kept(i, self.frame.valves), True))
            part = np.linalg.solve(
                self.frame.basis[i][np.ix_(free, free)], (theta - self.frame.theta[i])[free]
            )
            x[place + free] = part
        return x, found

    def solve(
        self, start: FloatArray, smoothing: FloatArray, x: FloatArray | None = None
    ) -> SolvedStart:
        """Run IPOPT once from frictions, then solve the coefficients with the frictions held.

        The unknowns ``x`` are those of the start (15) unless given.
        """
        count = 2 * self.frame.valves
        low, high = np.full(self.frame.size, -np.inf), np.full(self.frame.size, np.inf)
        low[:count], high[:count] = 0.0, np.repeat(self.data.limit / self.data.op_span, 2)
        low[self.frame.held], high[self.frame.held] = 0.0, 0.0
        answer = self._solver(
            x0=self.start(start) if x is None else x,
            p=smoothing * self.data.op_span,
            lbx=low,
            ubx=high,
            lbg=0.0,
            ubg=np.inf,
        )
        stats = self._solver.stats()
        end = np.array(answer["x"]).ravel()
        slack = np.array(answer["g"]).ravel()
        friction = end[:count].reshape(-1, 2) * self.data.op_span[:, None]
        objective, stable = float(answer["f"]) * self.frame.start_error, False
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

    def _build_solver(self) -> Any:
        """Return the solver; derivatives are those of stems expanded about the frictions of x."""
        count = 2 * self.frame.valves
        x, tau = ca.MX.sym("x", self.frame.size), ca.MX.sym("tau", self.frame.valves)
        about, weight, price = ca.MX.sym("f", count), ca.MX.sym("w"), ca.MX.sym("v", count)
        (f0, g0), (f1, g1), (f2, g2) = [self._terms(x, about, tau, k) for k in range(3)]
        bent = ca.triu(ca.hessian(weight * f2 + ca.dot(price, g2), x)[0])

        def here(*expressions: Any) -> list[Any]:
            return list(ca.substitute(list(expressions), [about], [x[:count]]))

        options: dict[str, Any] = {
            "print_time": False,
            "no_nlp_grad": True,
            "calc_f": False,
            "calc_g": False,
            "calc_lam_p": False,
            "ipopt": IPOPT | {"max_iter": MAX_ITERATIONS},
            "grad_f": ca.Function(
                "grad_f", [x, tau], here(f1, ca.gradient(f1, x)), ["x", "p"], ["f", "grad_f_x"]
            ),
            "jac_g": ca.Function(
                "jac_g", [x, tau], here(g1, ca.jacobian(g1, x)), ["x", "p"], ["g", "jac_g_x"]
            ),
            "hess_lag": ca.Function(
                "hess_lag",
                [x, tau, weight, price],
                here(bent),
                ["x", "p", "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        }
        objective, limits = here(f0, g0)
        problem = {"x": x, "p": tau, "f": objective, "g": limits}
        return ca.nlpsol("friction", "ipopt", problem, options)

    def _terms(self, x: Any, about: Any, smoothing: Any, order: int) -> tuple[Any, Any]:
        """Return (12a) over its start's value, f_S − f_D (12e) and σ²(χ)/(α σ²(u)) − 1 (12f)."""
        count, valves = self.data.op.shape[1], self.frame.valves
        stems = [self._stem(j, x, about, smoothing, order) for j in range(valves)]
        total = sum(ca.sumsqr(self._residual(i, x, stems)) for i in range(self.frame.outputs))
        ordered = [x[2 * j] - x[2 * j + 1] for j in range(valves)]
        moving = [
            ca.sumsqr(stem - ca.sum2(stem) / count) / (ALPHA * float(op.var()) * count) - 1.0
            for stem, op in zip(stems, self.data.op, strict=True)
        ]
        return total / (self.frame.outputs * self.frame.start_error), ca.vertcat(*ordered, *moving)

    def _stem(self, j: int, x: Any, about: Any, smoothing: Any, order: int) -> Any:
        """Return χ of valve j, shape (1, N), as its Taylor polynomial in f_S and f_D."""
        own = slice(2 * j, 2 * j + 2)
        step, op = x[own] - about[own], self.data.op[j]
        stem, *derived = self.data.stems[order].call([op, about[own], smoothing[j]])
        for power, term in enumerate(derived, start=1):
            for k in range(power):
                term = ca.reshape(ca.mtimes(term, step) / (k + 1), len(op), -1)
            stem = stem + term
        return stem.T

    def _residual(self, i: int, x: Any, stems: list[Any]) -> Any:
        """Return the error of the prediction (12c) of output i, shape (1, N − ε)."""
        frame, orders, count = self.frame, self.data.orders, self.data.op.shape[1]
        place = 2 * frame.valves + i * frame.width
        theta = frame.theta[i] + ca.mtimes(ca.DM(frame.basis[i]), x[place : place + frame.width])
        lagged = [
            stem[:, orders.first - delay - lag : count - delay - lag]
            for stem, delay in zip(stems, self.delays[i], strict=True)
            for lag in range(1, orders.input + 1)
        ]
        ones = ca.DM.ones(1, count - orders.first)
        phi = ca.vertcat(ca.DM(frame.past[i].T), *lagged, ones)
        return ca.mtimes(theta.T, phi) - ca.DM(self.data.pv[i, orders.first :][None, :])
