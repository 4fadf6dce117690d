"""Stiction-unaware MPC, equation (19): the stem is taken to follow OP, or to be made to by φ⁻¹."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.belief import ValveBeliefs, jump_form
from stiction_ros.control.formulation import Formulation
from stiction_ros.control.horizon import HorizonCost, HorizonLimits, HorizonWeights
from stiction_ros.control.pattern_problem import PatternProblem, StickyState
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.effects.friction.stiction import JumpForm
from stiction_ros.processes import LinearModel


class UnawareMpc(Formulation):
    """Offset-free linear MPC with bounds on OP, on its moves, and soft bounds on PV."""

    mode = ControlMode.UNAWARE

    def __init__(self, model: LinearModel, weights: HorizonWeights, limits: HorizonLimits) -> None:
        """Condense the problem; limits as in :class:`HorizonLimits`."""
        self.limits = limits
        self.cost = HorizonCost(model, weights)
        self._problem = PatternProblem(self.cost, limits, (None,) * model.b.shape[1])

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the best plan from state ξ̂ (n,) and the last stems (m,), or None."""
        none = np.zeros_like(last)
        valves = StickyState(last, np.column_stack([last, last]), none, none, none)
        found = self._problem.solve(state, target, valves)
        if found is None:
            return None
        cost = found.cost
        cost += self.cost.constant(state - target.state, last - target.stem, target.path)
        stem = found.plan + target.stem
        low, high = self.limits.stem[:, 0], self.limits.stem[:, 1]
        op = np.minimum(np.maximum(stem[0], low), high)
        pv = predicted_outputs(self.cost, state, target, found.plan)
        return Plan(op, stem, pv, found.slack, cost=cost)


def predicted_outputs(
    cost: HorizonCost, state: FloatArray, target: Target, plan: FloatArray
) -> FloatArray:
    """Return outputs at samples 0 … N, shape (N + 1, p), of stems less χ_ss, shape (N, m)."""
    deviation = state - target.state
    pv = np.empty((cost.horizon + 1, len(target.pv)))
    pv[0] = cost.model.c @ deviation + target.pv
    pv[1:] = cost.outputs(deviation, plan) + target.pv
    return pv


class InversionMpc(Formulation):
    """The unaware controller followed by φ⁻¹ of each sticky valve, as proposed in [34].

    Attributes:
        forms: jump form of each valve, None for a healthy one.
    """

    mode = ControlMode.INVERSION

    def __init__(self, linear: UnawareMpc, frictions: Sequence[Behaviour | None]) -> None:
        """Wrap ``linear``; ``frictions`` has one entry per valve, None for a healthy one."""
        self.linear = linear
        self.forms: tuple[JumpForm | None, ...] = tuple(
            None if friction is None else jump_form(friction) for friction in frictions
        )

    @property
    def least_kicks(self) -> list[float]:
        """Move of OP that the smallest jump of each valve takes from rest, (m,), %; else 0."""
        return [0.0 if form is None else form.op(0.0, form.least) for form in self.forms]

    def learn(self, valves: ValveBeliefs, stem: FloatArray) -> None:
        self.forms = valves.forms

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the linear plan with its first stems inverted into OP, or None."""
        plan = self.linear.plan(state, target, last)
        if plan is None:
            return None
        op = plan.op.copy()
        for j, form in enumerate(self.forms):
            if form is not None:
                op[j] = form.inverse(float(last[j]), float(plan.stem[0, j]))
        limits = self.linear.limits.stem
        return dataclasses.replace(plan, op=np.clip(op, limits[:, 0], limits[:, 1]))
