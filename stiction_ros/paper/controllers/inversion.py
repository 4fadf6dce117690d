"""Stiction inversion as the paper prints it: a purely linear MPC ahead of φ⁻¹."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.formulation import Formulation
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.paper.controllers.embedding import PrintedEmbeddingMpc
from stiction_ros.paper.controllers.laws import printed_frictions
from stiction_ros.paper.controllers.weights import PaperTuning


class PrintedInversionMpc(Formulation):
    r"""(19) in ũ, followed by the inverse of the two branches of (4) that move the stem.

    .. math::
        u_k = \tilde u_k + f_D \text{sign}(\tilde u_k - \tilde u_{k-1})

    It is exact while every move of ũ exceeds J = f_S − f_D. In closed loop most do not; then
    the stem stays, ũ is not χ, and the difference ends up in the disturbance estimate: the
    observer is fed with ũ, taken for the stem (ũ ≡ χ).
    """

    mode = ControlMode.INVERSION

    def __init__(self, linear: UnawareMpc, frictions: Sequence[Behaviour | None]) -> None:
        """Wrap ``linear``; ``frictions`` has one entry per valve, None for a healthy one."""
        if np.isfinite(linear.limits.move).any():
            raise InputError(
                "the paper's inversion knows no rate limits",
                where="op_rate_limits",
                fix="leave them out, or use formulation: exact",
            )
        self.linear, self.frictions = linear, printed_frictions(frictions)
        self._before: FloatArray | None = None  # u_{k−1}

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the linear plan from ξ̂ (n,) and ũ_{k−1} ``last`` (m,), inverted, or None."""
        plan = self.linear.plan(state, target, last)
        if plan is None:
            return None
        wanted = plan.stem[0]
        op = plan.op.copy()
        for j, friction in enumerate(self.frictions):
            if friction is not None:
                if wanted[j] == last[j] and self._before is not None:
                    op[j] = self._before[j]
                else:
                    op[j] = wanted[j] + friction.dynamic_friction * np.sign(wanted[j] - last[j])
        limits = self.linear.limits.stem
        op = np.clip(op, limits[:, 0], limits[:, 1])
        self._before = op.copy()
        return dataclasses.replace(plan, op=op, process_input=wanted.copy())


def as_printed(
    tuning: PaperTuning,
    mode: ControlMode,
    unaware: UnawareMpc,
    frictions: Sequence[Behaviour | None],
) -> Formulation:
    """Return the formulation of Section 4.2 to the letter; ``tuning`` is that of the embedding.

    The others are as :attr:`~stiction_ros.control.design.ControlDesign.others` is called.
    """
    if mode is ControlMode.EMBEDDING:
        return PrintedEmbeddingMpc(unaware.cost.model, tuning, unaware.limits, frictions)
    return PrintedInversionMpc(unaware, frictions)
