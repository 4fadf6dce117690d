"""Stiction-embedding MPC by exact enumeration of the moves that a sticky valve can make."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from stiction_ros.control.horizon import (
    HorizonCost,
    HorizonLimits,
    HorizonQp,
    HorizonSolution,
    HorizonWeights,
)
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.control.unaware import predicted_outputs
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

# Samples between two opposite jumps, by the number of sticky valves: patterns multiply.
SECOND_JUMPS = {1: (1, 2, 3, 5, 8), 2: (1, 2, 5), 3: (2,)}

LEAST_MARGIN = 1e-4  # %; by (4) an error of exactly f_S does not slip


@dataclasses.dataclass(frozen=True)
class JumpPattern:
    """Moves of one sticky valve: none, one jump now, or a second opposite one later.

    Attributes:
        direction: sign of the first jump, 0 for staying.
        second: samples until the opposite jump, 0 for none.
    """

    direction: int
    second: int = 0

    @property
    def jumps(self) -> int:
        """Number of jumps, 0 to 2."""
        return 0 if self.direction == 0 else 1 + (self.second > 0)


def patterns(sticky: int) -> tuple[JumpPattern, ...]:
    """Return the patterns of each of ``sticky`` valves: stay, ± one jump, ± two jumps."""
    found = [JumpPattern(0)]
    for direction in (1, -1):
        found.append(JumpPattern(direction))
        found.extend(JumpPattern(direction, second) for second in SECOND_JUMPS[sticky])
    return tuple(found)


@dataclasses.dataclass(frozen=True)
class EmbeddingTuning:
    """How sticky valves are moved.

    Attributes:
        jump_price: cost added per jump, in the units of the criterion.
        jump_margin: how far a jump exceeds the smallest one, as a share of f_S; it must
            exceed the relative uncertainty of f_S plus that of f_D.
    """

    jump_price: float = 0.0
    jump_margin: float = 0.3


class EmbeddingMpc:
    r"""The controller that knows the friction, written in the stem position.

    Under He's law (4) a stem either stays or jumps by at least J:

    .. math::
        \Delta\chi = 0 \quad\text{with } u = \hat\chi, \qquad
        |\Delta\chi| \ge J + \text{margin} \quad\text{with } u = \chi + f_D \text{sign}(\Delta\chi).

    For every pattern of jumps the rest is a small convex quadratic programme in the sizes of
    the jumps and in the moves of the healthy valves; the cheapest plan is applied.
    """

    mode = ControlMode.EMBEDDING

    def __init__(
        self,
        model: LinearModel,
        weights: HorizonWeights,
        limits: HorizonLimits,
        frictions: tuple[HeStiction | None, ...],
        tuning: EmbeddingTuning,
    ) -> None:
        """Factorise one problem per combination of patterns.

        Raises:
            InputError: no sticky valve, more than three, or one whose travel leaves no room.
        """
        self.cost = HorizonCost(model, weights)
        self.limits, self.frictions, self.tuning = limits, frictions, tuning
        self._sticky = [j for j, friction in enumerate(frictions) if friction is not None]
        if not 1 <= len(self._sticky) <= max(SECOND_JUMPS):
            raise InputError(
                f"{len(self._sticky)} sticky valves", fix="embedding takes one to three"
            )
        choices = patterns(len(self._sticky))
        self._problems = tuple(
            _Problem(self.cost, limits, frictions, combination, tuning)
            for combination in itertools.product(choices, repeat=len(self._sticky))
        )

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return the cheapest plan from ξ̂ (n,) and the stem estimates ``last`` (m,), or None."""
        best: tuple[float, _Problem, HorizonSolution] | None = None
        for problem in self._problems:
            solution = problem.solve(state, target, last)
            if solution is None:
                continue
            cost = solution.cost + self.tuning.jump_price * problem.jumps
            if best is None or cost < best[0]:
                best = (cost, problem, solution)
        if best is None:
            return None
        _, problem, solution = best
        stem = solution.plan + target.stem
        op = stem[0].copy()
        for j, pattern in zip(self._sticky, problem.combination, strict=True):
            friction = self.frictions[j]
            assert friction is not None
            op[j] = stem[0, j] + pattern.direction * friction.dynamic_friction
        op = np.clip(op, self.limits.stem[:, 0], self.limits.stem[:, 1])
        pv = predicted_outputs(self.cost, state, target, solution.plan)
        return Plan(op, stem, pv, solution.slack, problem.jumps)


class _Problem:
    """(19) for one combination of jump patterns.

    The decision variables are, valve by valve, the stem after each jump for a sticky valve
    and the stem at every sample for a healthy one, all in deviations from the target.
    """

    def __init__(
        self,
        cost: HorizonCost,
        limits: HorizonLimits,
        frictions: tuple[HeStiction | None, ...],
        combination: tuple[JumpPattern, ...],
        tuning: EmbeddingTuning,
    ) -> None:
        self.combination = combination
        self.jumps = sum(pattern.jumps for pattern in combination)
        self._limits, self._horizon, self._width = limits, cost.horizon, len(frictions)
        remaining = iter(combination)
        columns: list[FloatArray] = []
        rows: list[tuple[int, int]] = []  # (column of a stem, column of the stem before or -1)
        self._stays: list[int] = []
        self._sizes: list[tuple[int, JumpPattern, float, float]] = []
        self._healthy: list[tuple[int, int]] = []  # (valve, first column)
        for j, friction in enumerate(frictions):
            if friction is None:
                first = len(columns)
                self._healthy.append((j, first))
                columns += [self._column(j, i, i + 1) for i in range(cost.horizon)]
                if np.isfinite(limits.move[j]):
                    rows += [(first + i, first + i - 1) for i in range(1, cost.horizon)]
                continue
            pattern = next(remaining)
            margin = tuning.jump_margin * friction.static_friction
            least = friction.jump + max(margin, LEAST_MARGIN)
            if pattern.direction == 0:
                self._stays.append(j)
                continue
            self._sizes.append((j, pattern, least, friction.dynamic_friction))
            if pattern.second == 0:
                columns.append(self._column(j, 0, cost.horizon))
            else:
                rows.append((len(columns) + 1, len(columns)))
                columns.append(self._column(j, 0, pattern.second))
                columns.append(self._column(j, pattern.second, cost.horizon))
        shape = np.array(columns).T if columns else np.zeros((cost.horizon * self._width, 0))
        matrix = np.zeros((len(rows), shape.shape[1]))
        for i, (column, before) in enumerate(rows):
            matrix[i, column], matrix[i, before] = 1.0, -1.0
        self._rows = len(rows)
        self._qp = HorizonQp(cost, np.ascontiguousarray(shape), matrix, limits.output)

    def _column(self, valve: int, first: int, last: int) -> FloatArray:
        column = np.zeros((self._horizon, self._width))
        column[first:last, valve] = 1.0
        return column.reshape(-1)

    def solve(self, state: FloatArray, target: Target, last: FloatArray) -> HorizonSolution | None:
        deviation = last - target.stem
        offset = np.zeros((self._horizon, self._width))
        for j in self._stays:
            offset[:, j] = deviation[j]
        lower, upper = self._bounds(target, deviation)
        return self._qp.solve(
            state - target.state, deviation, offset.reshape(-1), lower, upper, target.pv
        )

    def _bounds(self, target: Target, deviation: FloatArray) -> tuple[FloatArray, FloatArray]:
        limits, horizon = self._limits, self._horizon
        size = self._qp.size
        lower, upper = np.empty(size + self._rows), np.empty(size + self._rows)
        column, row = 0, size
        healthy, sizes = iter(self._healthy), iter(self._sizes)
        entry, jump = next(healthy, None), next(sizes, None)
        for j in range(self._width):
            low, high = limits.stem[j] - target.stem[j]
            if entry is not None and entry[0] == j:
                lower[column : column + horizon], upper[column : column + horizon] = low, high
                move = limits.move[j]
                if np.isfinite(move):
                    lower[column] = max(low, deviation[j] - move)
                    upper[column] = min(high, deviation[j] + move)
                    lower[row : row + horizon - 1] = -move
                    upper[row : row + horizon - 1] = move
                    row += horizon - 1
                column += horizon
                entry = next(healthy, None)
            elif jump is not None and jump[0] == j:
                _, pattern, least, dynamic = jump
                stems = [(pattern.direction, deviation[j])]
                if pattern.second:
                    # The second jump starts at a decision variable: a row keeps its size.
                    stems.append((-pattern.direction, None))
                    lower[row] = least if pattern.direction < 0 else -1e30
                    upper[row] = -least if pattern.direction > 0 else 1e30
                    row += 1
                for sign, start in stems:
                    lower[column], upper[column] = low, high
                    # OP = stem ± f_D must stay within the limits as well.
                    if sign > 0:
                        upper[column] = high - dynamic
                        if start is not None:
                            lower[column] = max(low, start + least)
                    else:
                        lower[column] = low + dynamic
                        if start is not None:
                            upper[column] = min(high, start - least)
                    column += 1
                jump = next(sizes, None)
        return lower, upper
