"""Stiction inversion: a linear MPC plans the stem, the inverse of the law turns it into OP."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.beliefs import ValveBeliefs
from stiction_ros.control.formulation import Formulation
from stiction_ros.control.jump_form import JumpForm, jump_form
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects.behaviour import Behaviour, FloatArray


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
    def least_kicks(self) -> FloatArray:
        """Move of OP that the smallest jump of each valve takes from rest, (m,), %; else 0."""
        kicks = [0.0 if form is None else form.op(0.0, form.least) for form in self.forms]
        return np.array(kicks)

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
