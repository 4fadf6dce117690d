"""Stiction-embedding MPC by exact enumeration of the moves that a sticky valve can make."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.belief import ValveBeliefs, jump_form
from stiction_ros.control.certificate import FreeJumps
from stiction_ros.control.formulation import Formulation
from stiction_ros.control.horizon import HorizonCost, HorizonLimits, HorizonWeights
from stiction_ros.control.horizon_qp import HorizonSolution
from stiction_ros.control.pattern_bounds import PatternBounds
from stiction_ros.control.pattern_problem import JumpPattern, PatternProblem, StickyState
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.control.unaware import predicted_outputs
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.effects.friction.stiction import FrictionSpread, JumpForm
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

# Samples between two opposite jumps, by the number of sticky valves: patterns multiply.
SECOND_JUMPS = {1: (1, 2, 3, 5, 8), 2: (1, 2, 5), 3: (2,)}
ROUNDING = 1e-9  # of the cost, by which a bound must exceed it, and the least scale of a gap
# Samples that a single valve may wait before its first jump, and what may follow then.
WAITS = (1,)
WAITING_SECONDS = (0, 1)


def patterns(sticky: int, strokes: int = 1) -> tuple[JumpPattern, ...]:
    """Return the patterns of each of ``sticky`` valves: stay, ± one jump, ± two jumps.

    A single valve may also wait a sample first: without that a jump that is better later
    would be made now, since staying for good is the only other choice.

    A stem that slips at the last of several strokes jumps so much later, and after the rest
    behind a jump as much later again.
    """
    late = strokes - 1
    choices = [(0, second) for second in (0, *SECOND_JUMPS[sticky])]
    if sticky == 1:
        choices += [(wait, second) for wait in WAITS for second in WAITING_SECONDS]
    return JumpPattern(0), *(
        JumpPattern(direction, second and second + 2 * late, wait + late)
        for direction in (1, -1)
        for wait, second in choices
    )


@dataclasses.dataclass(frozen=True)
class EmbeddingTuning:
    """How sticky valves are moved."""

    jump_price: float = 0.0  # cost added per jump, in the units of the criterion
    # how far a jump exceeds the smallest one, as a share of f_S, where nothing is known of the
    # uncertainty of the frictions
    jump_margin: float = 0.3
    # least margin as a share of f_S where their intervals are known; the margin is then the
    # half-width of f_S's interval plus that of f_D's
    least_margin: float = 0.1
    # largest move of each OP in a sample, shape (m,), %, where a valve jumps; the smallest jump is
    # made all the same. Where the rate limit of OP is smaller it counts
    kick_limits: FloatArray | None = None
    # cost of the smallest jump of each valve, shape (m,), in place of its weight in S; larger jumps
    # cost as their squares; 0 leaves the weight
    move_prices: FloatArray | None = None


class EmbeddingMpc(Formulation):
    r"""The controller that knows the friction, written in the stem position.

    Under He's law (4), and others of the same
    :class:`~stiction_ros.control.belief.JumpForm`, a stem either stays or jumps by at
    least J:

    .. math::
        \Delta\chi = 0 \quad\text{with } u = \hat\chi, \qquad
        |\Delta\chi| \ge J + \text{margin} \quad\text{with } u = \chi + f_D \text{sign}(\Delta\chi).

    For every pattern of jumps the rest is a small convex quadratic programme in the sizes of
    the jumps and in the moves of the healthy valves; the cheapest plan is applied. Programmes are
    solved in the order of their :class:`~.pattern_bounds.PatternBounds`, until the bound of the
    next one is above the best cost found.

    Attributes:
        forms: jump form of each valve, None for a healthy one.
        move_weights: S, shape (m, m), by the prices of the jumps where they are given.
        solved: programmes that the last plan took.
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
        spreads: Sequence[FrictionSpread | None] | None = None,
    ) -> None:
        """Factorise one problem per combination of patterns, for up to three sticky valves."""
        self.limits, self.tuning = limits, tuning
        self._sticky = [j for j, friction in enumerate(frictions) if friction is not None]
        if not 1 <= len(self._sticky) <= max(SECOND_JUMPS):
            raise InputError(
                f"{len(self._sticky)} sticky valves", fix="embedding takes one to three"
            )
        self.know([None if f is None else jump_form(f) for f in frictions], spreads)
        priced = self._priced(weights)
        self.cost, self.move_weights = HorizonCost(model, priced), priced.move
        choices = [
            (None,) if form is None else patterns(len(self._sticky), form.strokes)
            for form in self.forms
        ]
        combinations = tuple(
            combination
            for combination in itertools.product(*choices)
            if all(p is None or p.wait + p.second < weights.horizon for p in combination)
        )
        self._problems = tuple(PatternProblem(self.cost, limits, one) for one in combinations)
        self._jumps = np.array([problem.jumps for problem in self._problems], dtype=float)
        self._bounds = PatternBounds(self.cost, combinations)
        self.solved = 0

    def _priced(self, weights: HorizonWeights) -> HorizonWeights:
        """Return ``weights`` with S such that the smallest jump of a sticky valve has its price."""
        if self.tuning.move_prices is None:
            return weights
        move = weights.move.copy()
        for j in self._sticky:
            if self.tuning.move_prices[j] > 0.0:
                move[j, j] = self.tuning.move_prices[j] / self._least[j] ** 2
        return dataclasses.replace(weights, move=move)

    def learn(self, valves: ValveBeliefs, stem: FloatArray) -> None:
        self.know(valves.forms, valves.spreads, valves.intervals(stem))

    def know(
        self,
        forms: Sequence[JumpForm | None],
        spreads: Sequence[FrictionSpread | None] | None = None,
        interval: FloatArray | None = None,
    ) -> None:
        """Set what is known of the m valves for the plans from now on.

        ``interval`` are lowest and highest stem positions, shape (m, 2), %; None when sure. Healthy
        valves stay healthy.
        """
        tuning = self.tuning
        self.forms = tuple(forms)
        self._interval = interval
        self._least, self._room = np.zeros(len(forms)), np.zeros(len(forms))
        self._largest = np.full(len(forms), np.inf)
        for j, form in enumerate(forms):
            if form is not None:
                spread = None if spreads is None else spreads[j]
                margin = form.margin(spread, tuning.jump_margin, tuning.least_margin)
                self._least[j] = form.least + margin
                self._room[j] = max(form.dynamic_friction, 0.0)
                kick = float(self.limits.move[j])
                if tuning.kick_limits is not None:
                    kick = min(kick, float(tuning.kick_limits[j]))
                if np.isfinite(kick):
                    # OP leads the stem by f_D, and a jump back takes that twice.
                    way = form.strokes * kick - 2.0 * self._room[j]
                    self._largest[j] = max(form.overshoot * way, self._least[j])
        travel = self.limits.stem[:, 1] - self.limits.stem[:, 0] - self._room
        self.immobile = tuple(j for j in self._sticky if self._least[j] > travel[j])

    @property
    def least_kicks(self) -> list[float]:
        """Move of OP that the smallest jump of each valve takes from rest, (m,), %; else 0."""
        both = zip(self.forms, self._least.tolist(), strict=True)
        return [0.0 if form is None else form.op(0.0, least) for form, least in both]

    def valves(self, last: FloatArray) -> StickyState:
        """Return what a problem must know of the valves, stems estimated at ``last`` (m,)."""
        interval = np.column_stack([last, last]) if self._interval is None else self._interval
        return StickyState(last, interval, self._least, self._largest, self._room)

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the cheapest plan from ξ̂ (n,) and the stem estimates ``last`` (m,), or None."""
        best: tuple[float, int, HorizonSolution] | None = None
        valves, converged = self.valves(last), True
        gradient = self.cost.linear(state - target.state, last - target.stem, target.path)
        bounds = self._bounds.of(gradient, last - target.stem, valves)
        bounds = bounds + self.tuning.jump_price * self._jumps
        if self.waits:
            bounds = np.where(self._jumps > 0, np.inf, bounds)
        self.solved = 0
        for i in np.argsort(bounds, kind="stable").tolist():
            if best is not None and bounds[i] > best[0] + ROUNDING * (1.0 + abs(best[0])):
                break
            problem = self._problems[i]
            solution = problem.solve(state, target, valves, gradient)
            self.solved += 1
            converged = converged and not problem.qp.limit_reached
            if solution is None:
                continue
            cost = solution.cost + self.tuning.jump_price * problem.jumps
            if best is None or (cost, i) < best[:2]:
                best = (cost, i, solution)
        if best is None:
            return None
        cost, i, solution = best
        problem = self._problems[i]
        stem = solution.plan + target.stem
        cost += self.cost.constant(state - target.state, last - target.stem, target.path)
        pv = predicted_outputs(self.cost, state, target, solution.plan)
        strokes = [1 if form is None else form.strokes for form in self.forms]
        op = self.op_of(last, stem[np.array(strokes) - 1, np.arange(len(last))])
        return Plan(op, stem, pv, solution.slack, problem.jumps, converged, cost)

    def optimality_gap(
        self, state: FloatArray, target: Target, last: FloatArray, plan: Plan, samples: int
    ) -> float | None:
        if self.waits:
            return None  # not the cheapest plan, and not meant to be
        optimum = self.optimum(state, target, last, samples)
        if optimum is None:
            return None
        return max(plan.cost - optimum, 0.0) / max(optimum, ROUNDING * (1.0 + abs(plan.cost)))

    def optimum(
        self, state: FloatArray, target: Target, last: FloatArray, samples: int
    ) -> float | None:
        """Return the least cost of any jumps in the first samples, None where it is not found."""
        valves, price = self.valves(last), self.tuning.jump_price
        free = FreeJumps(self.cost, self.limits, valves, self._sticky, price, samples)
        return free.optimum(state, target)

    def op_of(self, last: FloatArray, stem: FloatArray) -> FloatArray:
        """Return the OP (m,), %, that moves the stems from ``last`` (m,) to ``stem`` (m,)."""
        op = stem.copy()
        for j, form in enumerate(self.forms):
            if form is not None and abs(stem[j] - last[j]) > 0.5 * self._least[j]:
                op[j] = form.op(float(last[j]), float(stem[j]))
        return np.asarray(np.clip(op, self.limits.stem[:, 0], self.limits.stem[:, 1]))
