"""What a controller applies, in the order in which it is tried.

1. ``solve``: the formulation's plan, solved to the end.
2. ``limit``: its plan when other patterns ran out of iterations.
3. ``shift``: the next sample of an earlier plan, at most ``hold_after`` samples old.
4. ``unaware``: the plan of the unaware controller, where another one was in force.
5. ``fallback``: after ``fallback_after`` samples of holding, a ramp to a safe OP.
6. ``hold``: the last applied OP, until a plan is found again.

The mode is ``hold`` in the last two.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.formulation import Formulation
from stiction_ros.control.result import ControlMode, Plan, StepStatus
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.friction.stiction import JumpForm


@dataclasses.dataclass(frozen=True)
class FallbackRule:
    """How long a strategy may stand in."""

    hold_after: int = 5  # K, oldest age of a plan that is followed on, samples; then OP is held
    fallback_after: int = 0  # samples held until OP goes to ``fallback_op``; 0 holds for ever
    fallback_op: FloatArray | None = None  # where it goes, shape (m,), %; None where it never does
    fallback_rate: FloatArray | None = None  # largest move on the way, shape (m,), % per sample


@dataclasses.dataclass(frozen=True)
class Situation:
    """What one step has to go by."""

    state: FloatArray  # ξ̂, shape (n,)
    target: Target | None  # None when there is none, or when the inputs cannot be used
    last: FloatArray  # stem estimates, shape (m,), %
    applied: FloatArray  # the OP applied last, shape (m,), %
    forms: Sequence[JumpForm | None]  # jump forms of the valves, None for those taken to be healthy
    trouble: str  # why there is no target; empty when there is one


@dataclasses.dataclass(frozen=True)
class Proposal:
    """What is to be applied, by which strategy, and what :class:`~.result.StepResult` says."""

    op: FloatArray
    plan: Plan | None
    status: StepStatus
    strategy: str
    reason: str = ""
    age: int = 0
    mode: ControlMode | None = None  # where it differs from the formulation's


class Strategies:
    """The list above, with the last plan that was solved and the time for which OP was held."""

    def __init__(
        self, formulation: Formulation | None, stand_in: Formulation | None, rule: FallbackRule
    ) -> None:
        """Begin without a past; ``stand_in`` is the unaware controller, if not in force."""
        self._formulation, self._stand_in, self._rule = formulation, stand_in, rule
        self._plan: Plan | None = None
        self._age = self._held = 0

    def choose(self, situation: Situation) -> Proposal:
        """Return the first proposal that there is; it is applied."""
        if self._formulation is None:
            proposal = _hold(situation, "mode hold")
        else:
            proposal = self._solved(situation, self._formulation) or self._standing_in(situation)
        if proposal.plan is not None and proposal.age == 0:
            self._plan, self._age, self._held = proposal.plan, 1, 0
        elif proposal.status in (StepStatus.HELD, StepStatus.FALLBACK):
            self.hold()
        else:
            self._age, self._held = self._age + 1, 0
        return proposal

    def hold(self) -> None:
        """Take in a sample in which OP stays where it is."""
        self._age, self._held = self._age + 1, self._held + 1

    def _solved(self, situation: Situation, formulation: Formulation) -> Proposal | None:
        plan = _plan_of(formulation, situation)
        if plan is None:
            return None
        if not plan.converged:
            reason = "out of iterations, the best plan so far is applied"
            return Proposal(plan.op, plan, StepStatus.LIMIT, "limit", reason)
        assert situation.target is not None
        if not situation.target.reachable:
            reason = "set-point out of reach, the nearest reachable one is held"
            return Proposal(plan.op, plan, StepStatus.UNREACHABLE, "solve", reason)
        return Proposal(plan.op, plan, StepStatus.SOLVED, "solve")

    def _standing_in(self, situation: Situation) -> Proposal:
        """Return what is applied where the formulation in force has no usable plan."""
        rule, plan, age = self._rule, self._plan, self._age
        trouble = situation.trouble or "no plan found"
        if plan is not None and age <= rule.hold_after and age < len(plan.stem):
            op = plan.stem[age].copy()
            for j, form in enumerate(situation.forms):
                if form is not None:
                    op[j] = form.inverse(float(situation.last[j]), float(op[j]))
            reason = f"{trouble}; a plan {age} samples old is followed"
            return Proposal(op, plan, StepStatus.SHIFTED, "shift", reason, age)
        other = None if self._stand_in is None else _plan_of(self._stand_in, situation)
        if other is not None:
            reason, mode = f"{trouble}; the unaware controller stands in", ControlMode.UNAWARE
            return Proposal(other.op, other, StepStatus.SUBSTITUTED, "unaware", reason, mode=mode)
        safe, rate = rule.fallback_op, rule.fallback_rate
        long = 0 < rule.fallback_after <= self._held
        if long and safe is not None and rate is not None:
            op = situation.applied + np.clip(safe - situation.applied, -rate, rate)
            reason, mode = f"{trouble}; OP goes to its fallback", ControlMode.HOLD
            return Proposal(op, None, StepStatus.FALLBACK, "fallback", reason, mode=mode)
        return _hold(situation, f"{trouble}; OP is held")


def _plan_of(formulation: Formulation, situation: Situation) -> Plan | None:
    """Return the plan of a formulation if it has a usable one."""
    if situation.target is None:
        return None
    plan = formulation.plan(situation.state, situation.target, situation.last)
    return plan if plan is not None and np.isfinite(plan.op).all() else None


def _hold(situation: Situation, reason: str) -> Proposal:
    op, mode = situation.applied, ControlMode.HOLD
    return Proposal(op, None, StepStatus.HELD, "hold", reason, mode=mode)
