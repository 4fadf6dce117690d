"""MPC as the paper prints it: stiction embedding, safeguarded by the hard model, and inversion."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.formulation import Formulation
from stiction_ros.control.horizon import HorizonLimits
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.control.unaware import UnawareMpc, predicted_outputs
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.paper.controllers.augmented_cost import (
    AugmentedCost,
    PlanProblem,
    PrintedFriction,
    printed_frictions,
)
from stiction_ros.paper.controllers.searched_start import SearchedStart
from stiction_ros.paper.controllers.smoothed_programme import SmoothedProgramme
from stiction_ros.paper.controllers.weights import PaperTuning, WarmStart
from stiction_ros.processes import LinearModel


@dataclasses.dataclass(frozen=True, kw_only=True)
class PrintedPlan(Plan):
    """The cheaper of two plans by (22) under the hard model (4), and what both cost."""

    iterations: int  # of IPOPT
    programme_cost: float  # inf where the programme has no answer
    warm_start_cost: float


class PrintedEmbeddingMpc(Formulation):
    """(19) with the augmented model and cost (22): IPOPT from a warm start, then the better.

    At τ = 10⁴ the smoothed model has no slope towards another pattern of slips, so IPOPT
    keeps or loses the pattern it starts with. Its answer and its warm start are therefore
    both simulated with the hard model, and the cheaper is applied. Soft bounds of the outputs
    do not enter it; the plan tells by how much it breaks them.
    """

    mode = ControlMode.EMBEDDING

    def __init__(
        self,
        model: LinearModel,
        tuning: PaperTuning,
        limits: HorizonLimits,
        frictions: Sequence[Behaviour | None],
    ) -> None:
        """Build the programme once; InputError for valves or bounds that it does not know."""
        known = printed_frictions(frictions)
        _check(limits, known)
        self.tuning, self.frictions = tuning, known
        self._limits, self._bounds = limits.stem, limits.output
        self.cost = AugmentedCost(model, tuning.weights, known)
        self._programme = SmoothedProgramme(self.cost, tuning, limits.stem)
        searches = tuning.warm_start is WarmStart.SEARCH
        self._search = SearchedStart(self.cost, limits.stem) if searches else None
        self._before: FloatArray | None = None  # u_{k−1}

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> PrintedPlan | None:
        """Return the better plan from ξ̂ (n,) and the stem estimates ``last`` (m,), or None."""
        situation = PlanProblem(state, last, target, self._before)
        start = self.warm_start(situation)
        stems = self.cost.stems(start, last)
        start_cost = self.cost.of_stems(situation, start, stems)
        found = self._programme.solve(situation, start, stems)
        cost = float("inf") if found.op is None else self.cost(situation, found.op)
        if not np.isfinite(min(cost, start_cost)):
            return None
        op = found.op if found.op is not None and cost <= start_cost else start
        self._before = op[0].copy()
        stems = self.cost.stems(op, last)
        pv = predicted_outputs(self.cost.part, state, target, stems - target.stem)
        low, high = self._bounds.T
        return PrintedPlan(
            op[0].copy(),
            stems,
            pv,
            np.maximum(np.maximum(pv[1:] - high, low - pv[1:]), 0.0).max(axis=0),
            self._jumps(stems, last),
            iterations=found.iterations,
            programme_cost=cost,
            warm_start_cost=start_cost,
        )

    def warm_start(self, situation: PlanProblem) -> FloatArray:
        """Return the sequence that the programme starts from, shape (N, m), %."""
        if self._search is not None:
            found = self._search.find(situation)
            if found is not None:
                return found
        goal, stem = situation.target.stem, situation.stem
        before = situation.op_before
        if self.tuning.warm_start is WarmStart.NONE:
            return np.clip(
                np.tile(before, (self.cost.horizon, 1)), self._limits[:, 0], self._limits[:, 1]
            )
        op = np.tile(goal, (self.cost.horizon, 1))
        for j, friction in enumerate(self.frictions):
            if friction is not None:
                ends = float(stem[j]), float(goal[j])
                a, horizon = self.tuning.first_move, self.cost.horizon
                op[:, j] = compensation(friction, float(before[j]), ends, horizon, a)
        return np.clip(op, self._limits[:, 0], self._limits[:, 1])

    def _jumps(self, stems: FloatArray, last: FloatArray) -> int:
        moves = np.diff(np.vstack([last, stems]), axis=0) != 0.0
        sticky = [j for j, friction in enumerate(self.frictions) if friction is not None]
        return int(moves[:, sticky].sum())


def _check(limits: HorizonLimits, frictions: tuple[PrintedFriction | None, ...]) -> None:
    if all(friction is None for friction in frictions):
        raise InputError("0 sticky valves", fix="embedding takes at least one")
    _refuse_rate_limits(limits, "embedding")


def _refuse_rate_limits(limits: HorizonLimits, formulation: str) -> None:
    if np.isfinite(limits.move).any():
        raise InputError(
            f"the paper's {formulation} knows no rate limits",
            where="op_rate_limits",
            fix="leave them out, or use formulation: exact",
        )


def compensation(
    friction: PrintedFriction,
    before: float,
    stems: tuple[float, float],
    horizon: int,
    first_move: float,
) -> FloatArray:
    r"""Return OP, shape (N,), %, of one valve by the three moves of (21).

    .. math::
        u_k &= u_{k-1} \pm a f_S & + \text{ if } u_{k-1} \ge \chi_{ss} \\
        u_{k+1} &= \chi_k \pm f_D & + \text{ if } u_k \ge \chi_k \\
        u_{k+2} &= \chi_{ss} \mp f_D & - \text{ if } u_{k+1} \ge \chi_{ss} \\
        u_{k+j} &= u_{k+2} & j > 2

    Args:
        friction: of the valve.
        before: u_{k−1}, %.
        stems: χ_{k−1} and χ_ss, %.
        horizon: N ≥ 1, samples.
        first_move: a; for a > 2 the first move slips wherever the stem rests in its band.
    """
    stem, goal = stems
    static, dynamic = friction.static_friction, friction.dynamic_friction
    first = before + (first_move * static if before >= goal else -first_move * static)
    moved = float(friction.simulate(np.array([first]), start=stem)[0])
    second = moved + (dynamic if first >= moved else -dynamic)
    third = goal - (dynamic if second >= goal else -dynamic)
    op = np.full(horizon, third)
    op[: min(2, horizon)] = (first, second)[:horizon]
    return op


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
        _refuse_rate_limits(linear.limits, "inversion")
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
