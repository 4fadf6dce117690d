"""The cost (22) of a sequence of controller outputs under He's hard model (4)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.horizon import HorizonCost
from stiction_ros.control.paper_weights import AugmentedWeights
from stiction_ros.control.target import Target
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.processes import LinearModel


@dataclasses.dataclass(frozen=True)
class PlanProblem:
    """What a plan starts from.

    Attributes:
        state: ξ̂, shape (n,).
        stem: χ_{−1}, shape (m,), %.
        target: ξ_ss, χ_ss and the outputs there; u_s = χ_ss, the steady OP that leaves
            the stem at rest in the middle of its band.
    """

    state: FloatArray
    stem: FloatArray
    target: Target


class AugmentedCost:
    r"""Equation (22) summed over the horizon, with the terminal penalty of (19a).

    .. math::
        \sum_{i=0}^{N-1} (z_i - z_{ss})^T Q_z (z_i - z_{ss}) + \Delta\chi_i^T Q_s \Delta\chi_i
            + (u_i - u_s)^T R (u_i - u_s) + (\xi_N - \xi_{ss})^T V_F (\xi_N - \xi_{ss}),
        \quad z_i = (\chi_{i-1}, \xi_i).
    """

    def __init__(
        self,
        model: LinearModel,
        weights: AugmentedWeights,
        frictions: Sequence[HeStiction | None],
    ) -> None:
        """Condense; ``frictions`` has one entry per valve, None for a healthy one."""
        self.model, self.weights, self.frictions = model, weights, tuple(frictions)
        self.part = HorizonCost(model, weights.in_stems)
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
        return cost + float(np.sum(away * (away @ weights.op)))
