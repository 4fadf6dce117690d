"""Stiction inversion: a linear MPC plans the stem, He's inverse turns it into OP."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray


class InversionMpc:
    """The unaware controller followed by φ⁻¹ of each sticky valve, as proposed in [34]."""

    mode = ControlMode.INVERSION

    def __init__(self, linear: UnawareMpc, frictions: tuple[HeStiction | None, ...]) -> None:
        """Wrap ``linear``; ``frictions`` has one entry per valve, None for a healthy one."""
        self.linear = linear
        self.frictions = frictions

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the linear plan with its first stems inverted into OP, or None."""
        plan = self.linear.plan(state, target, last)
        if plan is None:
            return None
        op = plan.op.copy()
        for j, friction in enumerate(self.frictions):
            if friction is not None:
                op[j] = friction.inverse(float(last[j]), float(plan.stem[0, j]))
        limits = self.linear.limits.stem
        return dataclasses.replace(plan, op=np.clip(op, limits[:, 0], limits[:, 1]))
