"""What a controller applies, in the order in which it is tried.

Each strategy returns a proposal or nothing; the first proposal is applied:

1. ``solve``: the formulation's plan, solved to the end.
2. ``limit``: its plan when the solver ran out of iterations, checked by the formulation.
3. ``shift``: the next sample of an earlier plan, at most ``hold_after`` samples old.
4. ``unaware``: the plan of the unaware controller, where another one was in force.
5. ``fallback``: after ``fallback_after`` samples of holding, a ramp to a safe OP.
6. ``hold``: the last applied OP, until a plan is found again.

The mode is ``hold`` in the last two.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from stiction_ros.control.formulation import Formulation
from stiction_ros.control.jump_form import JumpForm
from stiction_ros.control.result import ControlMode, Plan, StepStatus
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray


@dataclasses.dataclass(frozen=True)
class FallbackRule:
    """How long a strategy may stand in.

    Attributes:
        hold_after: K, oldest age of a plan that is followed on, samples; then OP is held.
        fallback_after: samples held until OP goes to ``fallback_op``; 0 holds for ever.
        fallback_op: where it goes, shape (m,), %; None where it never does.
        fallback_rate: largest move on the way there, shape (m,), % per sample.
    """

    hold_after: int = 5
    fallback_after: int = 0
    fallback_op: FloatArray | None = None
    fallback_rate: FloatArray | None = None


class Situation:
    """What one step has to go by.

    Attributes:
        state: ξ̂, shape (n,).
        target: None when there is none, or when the inputs cannot be used.
        last: stem estimates, shape (m,), %.
        applied: the OP applied last, shape (m,), %.
        forms: jump forms of the valves, None for those taken to be healthy.
        trouble: why there is no target; empty when there is one.
    """

    def __init__(
        self,
        state: FloatArray,
        target: Target | None,
        last: FloatArray,
        applied: FloatArray,
        forms: Sequence[JumpForm | None],
        trouble: str,
    ) -> None:
        """Collect."""
        self.state, self.target, self.last = state, target, last
        self.applied, self.forms, self.trouble = applied, forms, trouble

    def ask(self, formulation: Formulation) -> Plan | None:
        """Return the plan of ``formulation`` if it has a usable one."""
        if self.target is None:
            return None
        plan = formulation.plan(self.state, self.target, self.last)
        if plan is None or not np.isfinite(plan.op).all():
            return None
        return plan


@dataclasses.dataclass(frozen=True)
class Proposal:
    """What a strategy wants applied, and what :class:`~.result.StepResult` says of it."""

    op: FloatArray
    plan: Plan | None
    status: StepStatus
    reason: str
    age: int = 0
    mode: ControlMode | None = None  # where it differs from the formulation's


class Strategy(Protocol):
    """One entry of the list; ``name`` is what diagnostics say."""

    name: str

    def propose(self, situation: Situation) -> Proposal | None:
        """Return what to apply, or None to leave it to the next."""
        ...

    def applied(self, proposal: Proposal, mine: bool) -> None:
        """Be told what was applied, and whether it was the own proposal."""
        ...


class Solve:
    """The formulation, solved to the end."""

    name = "solve"

    def __init__(self, formulation: Formulation) -> None:
        """Ask ``formulation`` once per step; ``limit`` uses its answer too."""
        self.formulation = formulation
        self.unfinished: Plan | None = None

    def propose(self, situation: Situation) -> Proposal | None:
        self.unfinished = None
        plan = situation.ask(self.formulation)
        if plan is None:
            return None
        if not plan.converged:
            self.unfinished = plan
            return None
        assert situation.target is not None
        if not situation.target.reachable:
            reason = "set-point out of reach, the nearest reachable one is held"
            return Proposal(plan.op, plan, StepStatus.UNREACHABLE, reason)
        return Proposal(plan.op, plan, StepStatus.SOLVED, "")

    def applied(self, proposal: Proposal, mine: bool) -> None:
        return


class Limit:
    """The formulation's checked plan when the solver ran out of iterations."""

    name = "limit"

    def __init__(self, solve: Solve) -> None:
        """Take what ``solve`` left."""
        self._solve = solve

    def propose(self, situation: Situation) -> Proposal | None:
        plan = self._solve.unfinished
        if plan is None:
            return None
        reason = "out of iterations, the best plan so far is applied"
        return Proposal(plan.op, plan, StepStatus.LIMIT, reason)

    def applied(self, proposal: Proposal, mine: bool) -> None:
        return


class Shift:
    """The rest of the last plan that was solved."""

    name = "shift"

    def __init__(self, limit: int) -> None:
        """Take plans of at most ``limit`` samples of age."""
        self._limit = limit
        self._plan: Plan | None = None
        self._age = 0

    def propose(self, situation: Situation) -> Proposal | None:
        plan = self._plan
        if plan is None or self._age > self._limit or self._age >= len(plan.stem):
            return None
        op = plan.stem[self._age].copy()
        for j, form in enumerate(situation.forms):
            if form is not None:
                op[j] = form.inverse(float(situation.last[j]), float(op[j]))
        reason = f"{_trouble(situation)}; a plan {self._age} samples old is followed"
        return Proposal(op, plan, StepStatus.SHIFTED, reason, self._age)

    def applied(self, proposal: Proposal, mine: bool) -> None:
        if proposal.plan is not None and proposal.age == 0:
            self._plan, self._age = proposal.plan, 1
        else:
            self._age += 1


class Unaware:
    """The unaware controller in the place of another."""

    name = "unaware"

    def __init__(self, formulation: Formulation) -> None:
        """Ask ``formulation``."""
        self._formulation = formulation

    def propose(self, situation: Situation) -> Proposal | None:
        plan = situation.ask(self._formulation)
        if plan is None:
            return None
        reason = f"{_trouble(situation)}; the unaware controller stands in"
        return Proposal(plan.op, plan, StepStatus.SUBSTITUTED, reason, mode=ControlMode.UNAWARE)

    def applied(self, proposal: Proposal, mine: bool) -> None:
        return


class Fallback:
    """A ramp to the safe OP, once OP was held for long enough."""

    name = "fallback"

    def __init__(self, rule: FallbackRule) -> None:
        """Begin to count what is held."""
        self._rule = rule
        self._held = 0

    def propose(self, situation: Situation) -> Proposal | None:
        rule = self._rule
        if rule.fallback_op is None or rule.fallback_rate is None:
            return None
        if not rule.fallback_after or self._held < rule.fallback_after:
            return None
        way = rule.fallback_op - situation.applied
        op = situation.applied + np.clip(way, -rule.fallback_rate, rule.fallback_rate)
        reason = f"{_trouble(situation)}; OP goes to its fallback"
        return Proposal(op, None, StepStatus.FALLBACK, reason, mode=ControlMode.HOLD)

    def applied(self, proposal: Proposal, mine: bool) -> None:
        standing = proposal.status in (StepStatus.HELD, StepStatus.FALLBACK)
        self._held = self._held + 1 if standing else 0


class Hold:
    """The last applied OP, in mode ``hold``: the end of the list."""

    name = "hold"

    def __init__(self, asked: bool) -> None:
        """Say that this mode was ``asked`` for, or else why it came to it."""
        self._asked = asked

    def propose(self, situation: Situation) -> Proposal:
        reason = "mode hold" if self._asked else f"{_trouble(situation)}; OP is held"
        return Proposal(situation.applied, None, StepStatus.HELD, reason, mode=ControlMode.HOLD)

    def applied(self, proposal: Proposal, mine: bool) -> None:
        return


def _trouble(situation: Situation) -> str:
    return situation.trouble or "no plan found"


def strategies(
    formulation: Formulation | None, stand_in: Formulation | None, rule: FallbackRule
) -> tuple[Strategy, ...]:
    """Return the ordered list.

    Args:
        formulation: in force; None for the mode ``hold``.
        stand_in: the unaware controller, where ``formulation`` is another.
        rule: how long the strategies may stand in.
    """
    if formulation is None:
        return (Hold(asked=True),)
    solve = Solve(formulation)
    found: list[Strategy] = [solve, Limit(solve), Shift(rule.hold_after)]
    if stand_in is not None:
        found.append(Unaware(stand_in))
    return (*found, Fallback(rule), Hold(asked=False))
