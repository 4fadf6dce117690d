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
        self._qp = HorizonQp(self.cost, np.eye(size), rows, limits.output)
        self._offset = np.zeros(size)

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the best plan from state ξ̂ (n,) and the last stems (m,), or None."""
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
        )
        if solution is None:
            return None
        stem = solution.plan + target.stem
        op = np.clip(stem[0], self.limits.stem[:, 0], self.limits.stem[:, 1])
        pv = predicted_outputs(self.cost, state, target, solution.plan)
        return Plan(op, stem, pv, solution.slack)


def predicted_outputs(
    cost: HorizonCost, state: FloatArray, target: Target, plan: FloatArray
) -> FloatArray:
    """Return outputs at samples 0 … N, shape (N + 1, p), for stems ``plan`` off the target."""
    deviation = state - target.state
    now = cost.model.c @ deviation
    return np.vstack([now, cost.outputs(deviation, plan)]) + target.pv
