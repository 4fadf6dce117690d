"""Objective (12a) and constraints (12e), (12f) with exact derivatives, as CasADi expressions."""

from __future__ import annotations

from typing import Any

import casadi as ca

from stiction_ros.paper.programme.programme_data import Frame
from stiction_ros.paper.programme.stem_sensitivities import SECOND

ALPHA = 0.1


class Terms:
    """Objective and constraints with derivatives up to one order, as expressions."""

    def __init__(self, frame: Frame, x: Any, smoothing: Any, order: int) -> None:
        self.frame, self.data = frame, frame.data
        self.weight = 1.0 / (frame.outputs * frame.start_error)
        m, width = frame.valves, frame.width
        self.frictions = [x[2 * j : 2 * j + 2] for j in range(m)]
        self.stems = [
            self.data.stems.expression(
                order, self.data.op[j], ca.vertcat(self.frictions[j], smoothing[j])
            )
            for j in range(m)
        ]
        self.theta, self.phi, self.residuals = [], [], []
        for i in range(frame.outputs):
            place = 2 * m + i * width
            basis = ca.DM(frame.basis[i])
            self.theta.append(ca.DM(frame.theta[i]) + ca.mtimes(basis, x[place : place + width]))
            self.phi.append(self._regressors(i))
            target = self.data.pv[i, self.data.orders.first :][None, :]
            self.residuals.append(ca.mtimes(self.theta[i].T, self.phi[i]) - ca.DM(target))

    def _lagged(self, row: Any, i: int, j: int) -> list[Any]:
        """Return stem ``row`` of valve j at all lags of output i, each (1, N − ε)."""
        orders, count = self.data.orders, self.data.op.shape[1]
        ends = [self.frame.delays[i][j] + lag for lag in range(1, orders.input + 1)]
        return [row[:, orders.first - end : count - end] for end in ends]

    def _regressors(self, i: int) -> Any:
        past = self.frame.past[i].T
        stems = [
            row for j in range(len(self.stems)) for row in self._lagged(self.stems[j][0], i, j)
        ]
        return ca.vertcat(ca.DM(past), *stems, ca.DM.ones(1, past.shape[1]))

    def _filtered(self, row: Any, i: int, j: int) -> Any:
        """Return B_j(q) of output i applied to ``row``."""
        orders = self.data.orders
        first = orders.output + j * orders.input
        lagged = self._lagged(row, i, j)
        return sum(self.theta[i][first + lag] * part for lag, part in enumerate(lagged))

    def objective(self) -> Any:
        """Return (12a) over its value at the ARX start."""
        return self.weight * sum(ca.sumsqr(r) for r in self.residuals)

    def constraints(self) -> Any:
        """Return f_S − f_D per valve (12e), then σ²(χ)/(α σ²(u)) − 1 (12f)."""
        order = [friction[0] - friction[1] for friction in self.frictions]
        moving = [
            ca.sumsqr(_centred(rows[0])) / self._least(j) - 1.0 for j, rows in enumerate(self.stems)
        ]
        return ca.vertcat(*order, *moving)

    def _least(self, j: int) -> float:
        """Return N α σ²(u) of valve j, scaled."""
        return ALPHA * float(self.data.op[j].var()) * int(self.data.op.shape[1])

    def gradient(self) -> Any:
        """Return the gradient of the objective, shape (n, 1)."""
        by_friction: list[Any] = []
        for j, rows in enumerate(self.stems):
            for p in range(2):
                parts = [
                    ca.dot(self._filtered(rows[1 + p], i, j), r)
                    for i, r in enumerate(self.residuals)
                ]
                by_friction.append(sum(parts))
        by_theta = [
            ca.mtimes(ca.DM(self.frame.basis[i]).T, ca.mtimes(self.phi[i], r.T))
            for i, r in enumerate(self.residuals)
        ]
        return 2.0 * self.weight * ca.vertcat(*by_friction, *by_theta)

    def jacobian(self) -> Any:
        """Return the Jacobian of the constraints, shape (2m, n)."""
        order = [ca.DM([[1.0, -1.0]])] * len(self.stems)
        moving = []
        for j, rows in enumerate(self.stems):
            slopes = [ca.dot(_centred(rows[0]), rows[1 + p]) for p in range(2)]
            moving.append(2.0 / self._least(j) * ca.horzcat(*slopes))
        by_friction = ca.vertcat(ca.diagcat(*order), ca.diagcat(*moving))
        rest = self.frame.size - 2 * self.frame.valves
        return ca.horzcat(by_friction, ca.MX(2 * len(self.stems), rest))

    def hessian(self, weight: Any, price: Any) -> Any:
        """Return the Hessian of the Lagrangian, shape (n, n)."""
        pairs = [(j, p) for j in range(len(self.stems)) for p in range(2)]
        friction: Any = ca.MX.zeros(len(pairs), len(pairs))
        cross, theta = [], []
        for i, r in enumerate(self.residuals):
            slopes = [self._filtered(self.stems[j][1 + p], i, j) for j, p in pairs]
            stacked = ca.vertcat(*slopes)
            bends = [self._bend(i, j, r) for j in range(len(self.stems))]
            friction += ca.mtimes(stacked, stacked.T) + ca.diagcat(*bends)
            turned = ca.mtimes(self.phi[i], stacked.T) + self._by_lag(i, r, pairs)
            basis = ca.DM(self.frame.basis[i])
            cross.append(ca.mtimes(basis.T, turned))
            theta.append(ca.mtimes([basis.T, self.phi[i], self.phi[i].T, basis]))
        scale = 2.0 * self.weight * weight
        moving = [self._moving(j) * price[len(self.stems) + j] for j in range(len(self.stems))]
        corner = scale * friction + ca.diagcat(*moving)
        side = scale * ca.vertcat(*cross)
        return ca.vertcat(ca.horzcat(corner, side.T), ca.horzcat(side, scale * ca.diagcat(*theta)))

    def _bend(self, i: int, j: int, r: Any) -> Any:
        """Return Σ r B_j ∂²χ/∂f² of valve j, shape (2, 2)."""
        parts = {
            pair: ca.dot(self._filtered(self.stems[j][3 + k], i, j), r)
            for k, pair in enumerate(SECOND)
        }
        return _symmetric(parts)

    def _by_lag(self, i: int, r: Any, pairs: list[tuple[int, int]]) -> Any:
        """Return Σ r ∂Φ/∂f, shape (n_a + m n_b + 1, 2m)."""
        orders, m = self.data.orders, len(self.stems)
        columns = []
        for j, p in pairs:
            parts = [ca.dot(part, r) for part in self._lagged(self.stems[j][1 + p], i, j)]
            before = ca.MX.zeros(orders.output + j * orders.input)
            after = ca.MX.zeros((m - 1 - j) * orders.input + 1)
            columns.append(ca.vertcat(before, *parts, after))
        return ca.horzcat(*columns)

    def _moving(self, j: int) -> Any:
        """Return the Hessian of (12f) of valve j in its frictions, shape (2, 2)."""
        rows = self.stems[j]
        centred = _centred(rows[0])
        slopes = [_centred(rows[1 + p]) for p in range(2)]
        parts = {
            (p, q): ca.dot(slopes[p], slopes[q]) + ca.dot(centred, rows[3 + k])
            for k, (p, q) in enumerate(SECOND)
        }
        return 2.0 / self._least(j) * _symmetric(parts)


def _centred(row: Any) -> Any:
    return row - ca.sum2(row) / row.shape[1]


def _symmetric(parts: dict[tuple[int, int], Any]) -> Any:
    upper = ca.horzcat(parts[0, 0], parts[0, 1])
    return ca.vertcat(upper, ca.horzcat(parts[0, 1], parts[1, 1]))
