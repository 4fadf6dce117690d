"""The general warm start: a small dynamic optimisation of (22) under the hard model."""

import dataclasses

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.control.embedding import EmbeddingMpc, EmbeddingTuning
from stiction_ros.control.horizon import HorizonLimits, HorizonWeights
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.controllers.augmented_cost import AugmentedCost, PlanProblem
from stiction_ros.processes import LinearModel

LEAST_SLIP = 1e-3  # %; by (4) an error of exactly f_S does not slip
MARGIN = 1e-3  # of f_S, by which a jump exceeds the smallest one
MOVED = 1e-6  # %, from which on a stem has jumped


class SearchedStart:
    """The plan of the exact embedding under (22), written in OP.

    The states of (22) are χ_{i−1} and ξ_i, which are those of a linear model, too. What R costs is
    left out for sticky valves: while one rests its OP is as near to u_s as friction allows.
    """

    def __init__(self, cost: AugmentedCost, limits: FloatArray) -> None:
        """Set up the embedding for one to three sticky valves; ``limits`` (m, 2), %."""
        self.cost, self.limits = cost, limits
        model, weights = cost.model, cost.weights
        m, p, size = len(limits), len(model.pv0), len(limits) + model.order
        healthy = np.array([friction is None for friction in cost.frictions])
        follows = weights.op * np.outer(healthy, healthy)
        augmented = LinearModel(
            block_diag(np.zeros((m, m)), model.a),
            np.vstack([np.eye(m), model.b]),
            np.hstack([np.zeros((p, m)), model.c]),
            np.zeros((size, 0)),
            np.zeros(size),
            model.stem0,
            model.pv0,
        )
        self._embedding = EmbeddingMpc(
            augmented,
            HorizonWeights(
                weights.horizon,
                block_diag(weights.stem + follows, weights.state),
                weights.move,
                block_diag(follows, weights.terminal),
            ),
            HorizonLimits(limits, np.full(m, np.inf), np.tile([-np.inf, np.inf], (p, 1))),
            cost.frictions,
            EmbeddingTuning(jump_margin=MARGIN),
        )

    def find(self, situation: PlanProblem) -> FloatArray | None:
        """Return OP, shape (N, m), % within the limits; None when no plan is feasible."""
        target, last = situation.target, situation.stem
        goal = dataclasses.replace(target, state=np.concatenate([target.stem, target.state]))
        plan = self._embedding.plan(np.concatenate([last, situation.state]), goal, last)
        if plan is None:
            return None
        rest = self._op(np.tile(last, (self.cost.horizon, 1)), situation)
        moved = self._op(plan.stem, situation)
        return min((rest, moved), key=lambda op: self.cost(situation, op))

    def _op(self, stems: FloatArray, situation: PlanProblem) -> FloatArray:
        """Return OP that makes ``stems``: f_D beyond on a slip, near u_s at rest."""
        op, moves = stems.copy(), np.diff(np.vstack([situation.stem, stems]), axis=0)
        for j, friction in enumerate(self.cost.frictions):
            if friction is None:
                continue
            reach = max(friction.static_friction - LEAST_SLIP, 0.0)
            rest = np.clip(situation.target.stem[j], stems[:, j] - reach, stems[:, j] + reach)
            slipped = stems[:, j] + np.sign(moves[:, j]) * friction.dynamic_friction
            op[:, j] = np.where(np.abs(moves[:, j]) > MOVED, slipped, rest)
        return np.clip(op, self.limits[:, 0], self.limits[:, 1])
