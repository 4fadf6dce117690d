"""The cost (22) of a sequence of controller outputs, and the friction laws whose stems it knows.

A plan begins with the valve at rest, so what a moving stem would go on by itself is not planned.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.horizon import HorizonCost
from stiction_ros.control.target import Target
from stiction_ros.effects import HeStiction, KanoStiction, XchStiction
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.paper.controllers.weights import AugmentedWeights
from stiction_ros.processes import LinearModel

PrintedFriction = HeStiction | KanoStiction | XchStiction


def printed_frictions(frictions: Sequence[Behaviour | None]) -> tuple[PrintedFriction | None, ...]:
    """Return ``frictions`` when the paper's controllers can take all of them; else InputError."""
    known: list[PrintedFriction | None] = []
    for friction in frictions:
        if friction is not None and not isinstance(friction, PrintedFriction):
            raise InputError(
                f"the paper's controllers know He's law, Kano's and XCH's, not {friction.title()}",
                where="formulation",
                fix="use formulation: exact",
            )
        known.append(friction)
    return tuple(known)


@dataclasses.dataclass(frozen=True)
class PlanProblem:
    """What a plan starts from."""

    state: FloatArray  # ξ̂, shape (n,)
    stem: FloatArray  # χ_{−1}, shape (m,), %
    # ξ_ss, χ_ss and the outputs there; u_s = χ_ss, the steady OP that leaves the stem at rest in
    # the middle of its band
    target: Target
    before: FloatArray | None = None  # u_{−1}, shape (m,), %; None where OP was at the stem

    @property
    def op_before(self) -> FloatArray:
        """u_{−1}, shape (m,), %."""
        return self.stem if self.before is None else self.before


class AugmentedCost:
    r"""Equation (22) summed over the horizon, with the terminal penalty of (19a).

    .. math::
        \sum_{i=0}^{N-1} (z_i - z_{ss})^T Q_z (z_i - z_{ss}) + \Delta\chi_i^T Q_s \Delta\chi_i
            + (u_i - u_s)^T R (u_i - u_s) + (\xi_N - \xi_{ss})^T V_F (\xi_N - \xi_{ss}),
        \quad z_i = (\chi_{i-1}, \xi_i).

    Where the weights have S on Δu as well, as (19a) does, it is added.
    """

    def __init__(
        self,
        model: LinearModel,
        weights: AugmentedWeights,
        frictions: Sequence[PrintedFriction | None],
    ) -> None:
        """Condense, for ``frictions`` with None for a healthy valve."""
        self.model, self.weights, self.frictions = model, weights, tuple(frictions)
        self.part = HorizonCost(model, weights)
        self.horizon = weights.horizon

    def stems(self, op: FloatArray, start: FloatArray) -> FloatArray:
        """Return stems, shape (N, m), %, for ``op`` (N, m), from rest at ``start`` (m,)."""
        stems = op.copy()
        for j, friction in enumerate(self.frictions):
            if friction is not None:
                stems[:, j] = friction.simulate(op[:, j], start=float(start[j]))
        return stems

    def __call__(self, situation: PlanProblem, op: FloatArray) -> float:
        """Return the cost of ``op``, shape (N, m), %, in the units of the weights."""
        return self.of_stems(situation, op, self.stems(op, situation.stem))

    def of_stems(self, situation: PlanProblem, op: FloatArray, stems: FloatArray) -> float:
        """Return the cost of ``op`` when its stems, shape (N, m), are known already."""
        target, weights = situation.target, self.weights
        state, last = situation.state - target.state, situation.stem - target.stem
        plan = stems - target.stem
        flat = plan.reshape(-1)
        cost = float(flat @ (0.5 * self.part.hessian @ flat + self.part.linear(state, last)))
        cost += self.part.constant(state, last)
        before = np.vstack([last, plan[:-1]])
        away = op - target.stem
        cost += float(np.sum(before * (before @ weights.stem)))
        if weights.op_move is not None:
            moves = np.diff(np.vstack([situation.op_before, op]), axis=0)
            cost += float(np.sum(moves * (moves @ weights.op_move)))
        return cost + float(np.sum(away * (away @ weights.op)))
