"""Stiction-unaware MPC, equation (19): the stem is taken to follow OP."""

from __future__ import annotations

import numpy as np

from stiction_ros.control.horizon import HorizonCost, HorizonLimits, HorizonQp, HorizonWeights
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.processes import LinearModel


class UnawareMpc:
    """Offset-free linear MPC with bounds on OP, on its moves, and soft bounds on PV."""

    mode = ControlMode.UNAWARE

    def __init__(self, model: LinearModel, weights: HorizonWeights, limits: HorizonLimits) -> None:
        """Condense the problem; limits as in :class:`HorizonLimits`."""
        self.limits = limits
        self.cost = HorizonCost(model, weights)
        m = model.b.shape[1]
        size = weights.horizon * m
        limited = np.flatnonzero(np.isfinite(limits.move))
        picks = (np.arange(weights.horizon)[:, None] * m + limited).reshape(-1)
        self._limited, self._width = limited, m
        rows = (np.eye(size) - np.eye(size, k=-m))[picks]
        self._qp = HorizonQp(self.cost, np.eye(size), rows, limits.output, limits.iterations)
        self._offset = np.zeros(size)

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the best plan from state ξ̂ (n,) and the last stems (m,), or None.

        Out of iterations, the plan without bounds is cut to them, and returned if it is
        cheaper than leaving the stems where they are.
        """
        horizon = self.cost.horizon
        deviation = last - target.stem
        low = np.tile(self.limits.stem[:, 0] - target.stem, horizon)
        high = np.tile(self.limits.stem[:, 1] - target.stem, horizon)
        moves = np.tile(self.limits.move[self._limited], horizon)
        first = np.zeros_like(moves)
        first[: len(self._limited)] = deviation[self._limited]
        solution = self._qp.solve(
            state - target.state,
            deviation,
            self._offset,
            np.concatenate([low, first - moves]),
            np.concatenate([high, first + moves]),
            target.pv,
            target.path,
        )
        if solution is not None:
            return self._plan(state, target, last, solution.plan, solution.slack)
        if self._qp.limit_reached:
            return self._cut_plan(state, target, last)
        return None

    def _plan(
        self,
        state: FloatArray,
        target: Target,
        last: FloatArray,
        moved: FloatArray,
        slack: FloatArray,
        converged: bool = True,
    ) -> Plan:
        stem = moved + target.stem
        op = np.clip(stem[0], self.limits.stem[:, 0], self.limits.stem[:, 1])
        pv = predicted_outputs(self.cost, state, target, moved)
        cost = self._cost(state, target, last, moved, slack)
        return Plan(op, stem, pv, slack, converged=converged, cost=cost)

    def _cost(
        self,
        state: FloatArray,
        target: Target,
        last: FloatArray,
        moved: FloatArray,
        slack: FloatArray,
    ) -> float:
        z, before, v = state - target.state, last - target.stem, moved.reshape(-1)
        linear = self.cost.linear(z, before, target.path)
        total = float(v @ (0.5 * self.cost.hessian @ v + linear))
        return total + self.cost.constant(z, before, target.path) + self._qp.slack_cost(slack)

    def _cut_plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        before = last - target.stem
        linear = self.cost.linear(state - target.state, before, target.path)
        free = np.linalg.solve(self.cost.hessian, -linear).reshape(self.cost.horizon, -1)
        low, high = (self.limits.stem - target.stem[:, None]).T
        cut = np.empty_like(free)
        stem = np.clip(before, low, high)
        for i, wanted in enumerate(free):
            stem = np.clip(
                np.clip(wanted, stem - self.limits.move, stem + self.limits.move), low, high
            )
            cut[i] = stem
        stay = np.tile(np.clip(before, low, high), (self.cost.horizon, 1))
        both = [
            self._plan(
                state, target, last, v, self._qp.slack(state - target.state, v, target.pv), False
            )
            for v in (cut, stay)
        ]
        if not np.isfinite(both[0].cost) or both[0].cost > both[1].cost:
            return None
        return both[0]


def predicted_outputs(
    cost: HorizonCost, state: FloatArray, target: Target, plan: FloatArray
) -> FloatArray:
    """Return outputs at samples 0 … N, shape (N + 1, p), for stems ``plan`` off the target."""
    deviation = state - target.state
    now = cost.model.c @ deviation
    return np.vstack([now, cost.outputs(deviation, plan)]) + target.pv
