"""Stiction-embedding MPC by exact enumeration of the moves that a sticky valve can make."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.embedding_problem import EmbeddingProblem, JumpPattern, StickyState
from stiction_ros.control.horizon import (
    HorizonCost,
    HorizonLimits,
    HorizonSolution,
    HorizonWeights,
)
from stiction_ros.control.jump_form import FrictionSpread, JumpForm, jump_form
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.control.unaware import predicted_outputs
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

# Samples between two opposite jumps, by the number of sticky valves: patterns multiply.
SECOND_JUMPS = {1: (1, 2, 3, 5, 8), 2: (1, 2, 5), 3: (2,)}
# Samples that a single valve may wait before its first jump, and what may follow then.
WAITS = (1,)
WAITING_SECONDS = (0, 1)


def patterns(sticky: int) -> tuple[JumpPattern, ...]:
    """Return the patterns of each of ``sticky`` valves: stay, ± one jump, ± two jumps.

    A single valve may also wait a sample first: without that a jump that is better later
    would be made now, since staying for good is the only other choice.
    """
    found = [JumpPattern(0)]
    for direction in (1, -1):
        found.append(JumpPattern(direction))
        found.extend(JumpPattern(direction, second) for second in SECOND_JUMPS[sticky])
        if sticky == 1:
            found.extend(JumpPattern(direction, s, w) for w in WAITS for s in WAITING_SECONDS)
    return tuple(found)


@dataclasses.dataclass(frozen=True)
class EmbeddingTuning:
    """How sticky valves are moved.

    Attributes:
        jump_price: cost added per jump, in the units of the criterion.
        jump_margin: how far a jump exceeds the smallest one, as a share of f_S, where nothing
            is known of the uncertainty of the frictions.
        least_margin: least margin as a share of f_S where their intervals are known; the
            margin is then the half-width of f_S's interval plus that of f_D's.
    """

    jump_price: float = 0.0
    jump_margin: float = 0.3
    least_margin: float = 0.1


class EmbeddingMpc:
    r"""The controller that knows the friction, written in the stem position.

    Under He's law (4), and others of the same :class:`~.jump_form.JumpForm`, a stem either
    stays or jumps by at least J:

    .. math::
        \Delta\chi = 0 \quad\text{with } u = \hat\chi, \qquad
        |\Delta\chi| \ge J + \text{margin} \quad\text{with } u = \chi + f_D \text{sign}(\Delta\chi).

    For every pattern of jumps the rest is a small convex quadratic programme in the sizes of
    the jumps and in the moves of the healthy valves; the cheapest plan is applied.

    Attributes:
        forms: jump form of each valve, None for a healthy one.
        immobile: valves whose smallest jump has no room within the limits.
    """

    mode = ControlMode.EMBEDDING

    def __init__(
        self,
        model: LinearModel,
        weights: HorizonWeights,
        limits: HorizonLimits,
        frictions: Sequence[Behaviour | None],
        tuning: EmbeddingTuning,
    ) -> None:
        """Factorise one problem per combination of patterns.

        Raises:
            InputError: no sticky valve, more than three, or a law without a jump form.
        """
        self.cost = HorizonCost(model, weights)
        self.limits, self.tuning = limits, tuning
        self._sticky = [j for j, friction in enumerate(frictions) if friction is not None]
        if not 1 <= len(self._sticky) <= max(SECOND_JUMPS):
            raise InputError(
                f"{len(self._sticky)} sticky valves", fix="embedding takes one to three"
            )
        self.know([None if f is None else jump_form(f) for f in frictions])
        one = patterns(len(self._sticky))
        choices = [one if f is not None else (None,) for f in frictions]
        self._problems = tuple(
            EmbeddingProblem(self.cost, limits, combination)
            for combination in itertools.product(*choices)
            if _fits(combination, weights.horizon)
        )

    def know(
        self,
        forms: Sequence[JumpForm | None],
        spreads: Sequence[FrictionSpread | None] | None = None,
        interval: FloatArray | None = None,
    ) -> None:
        """Set what is known of the valves for the plans from now on.

        Args:
            forms: jump form of each of the m valves; None for the healthy ones, as before.
            spreads: half-widths of the intervals of the frictions, None where unknown.
            interval: lowest and highest stem position, shape (m, 2), %; None when sure.
        """
        tuning = self.tuning
        self.forms = tuple(forms)
        self._interval = interval
        self._least, self._room = np.zeros(len(forms)), np.zeros(len(forms))
        for j, form in enumerate(forms):
            if form is not None:
                spread = None if spreads is None else spreads[j]
                margin = form.margin(spread, tuning.jump_margin, tuning.least_margin)
                self._least[j] = form.least + margin
                self._room[j] = max(form.dynamic_friction, 0.0)
        travel = self.limits.stem[:, 1] - self.limits.stem[:, 0] - self._room
        self.immobile = tuple(j for j in self._sticky if self._least[j] > travel[j])

    def valves(self, last: FloatArray) -> StickyState:
        """Return what a problem must know of the valves, stems estimated at ``last`` (m,)."""
        interval = np.column_stack([last, last]) if self._interval is None else self._interval
        return StickyState(last, interval, self._least, self._room)

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the cheapest plan from ξ̂ (n,) and the stem estimates ``last`` (m,), or None."""
        best: tuple[float, EmbeddingProblem, HorizonSolution] | None = None
        valves, converged = self.valves(last), True
        gradient = self.cost.linear(state - target.state, last - target.stem, target.path)
        for problem in self._problems:
            solution = problem.solve(state, target, valves, gradient)
            converged = converged and not problem.limit_reached
            if solution is None:
                continue
            cost = solution.cost + self.tuning.jump_price * problem.jumps
            if best is None or cost < best[0]:
                best = (cost, problem, solution)
        if best is None:
            return None
        cost, problem, solution = best
        stem = solution.plan + target.stem
        cost += self.cost.constant(state - target.state, last - target.stem, target.path)
        pv = predicted_outputs(self.cost, state, target, solution.plan)
        op = self.op_of(last, stem[0])
        return Plan(op, stem, pv, solution.slack, problem.jumps, converged, cost)

    def op_of(self, last: FloatArray, stem: FloatArray) -> FloatArray:
        """Return the OP (m,), %, that moves the stems from ``last`` (m,) to ``stem`` (m,)."""
        op = stem.copy()
        for j, form in enumerate(self.forms):
            if form is not None and abs(stem[j] - last[j]) > 0.5 * self._least[j]:
                op[j] = form.op(float(last[j]), float(stem[j]))
        return np.asarray(np.clip(op, self.limits.stem[:, 0], self.limits.stem[:, 1]))


def _fits(combination: tuple[JumpPattern | None, ...], horizon: int) -> bool:
    return all(p is None or p.wait + p.second < horizon for p in combination)
