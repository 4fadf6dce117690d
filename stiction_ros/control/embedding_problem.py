"""One quadratic programme of the exact embedding: the sticky valves move by given patterns."""

import dataclasses

import numpy as np

from stiction_ros.control.horizon import HorizonCost, HorizonLimits
from stiction_ros.control.horizon_qp import HorizonQp, HorizonSolution
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray

FREE = 1e30


@dataclasses.dataclass(frozen=True)
class JumpPattern:
    """Moves of one sticky valve: none, one jump, or a second opposite one later."""

    direction: int  # sign of the first jump, 0 for staying
    second: int = 0  # samples from the first jump to the opposite one, 0 for none
    wait: int = 0  # samples before the first jump

    @property
    def jumps(self) -> int:
        """Number of jumps, 0 to 2."""
        return 0 if self.direction == 0 else 1 + (self.second > 0)


@dataclasses.dataclass(frozen=True)
class StickyState:
    """What an embedding problem must know of the valves now; entries of healthy ones unused."""

    last: FloatArray  # stem estimates χ̂, shape (m,), %
    interval: FloatArray  # lowest and highest stem position that is possible, shape (m, 2), %
    least: FloatArray  # least, largest: jump with margin, shape (m,), %; the least is allowed
    largest: FloatArray
    room: FloatArray  # distance of a jumping stem from the limits, for OP's sake, (m,), %


class EmbeddingProblem:
    """(19) for one combination of jump patterns.

    The decision variables are, valve by valve, the stem after each jump for a sticky valve
    and the stem at every sample for a healthy one, all in deviations from the target.
    """

    def __init__(
        self, cost: HorizonCost, limits: HorizonLimits, combination: tuple[JumpPattern | None, ...]
    ) -> None:
        """Factorise for ``combination``, one pattern per valve, None for a healthy one."""
        self.combination = combination
        self.jumps = sum(pattern.jumps for pattern in combination if pattern is not None)
        self._limits, self._horizon, self._width = limits, cost.horizon, len(combination)
        columns: list[FloatArray] = []
        rows: list[tuple[int, int]] = []  # (column of a stem, column of the stem before)
        self._first: list[int] = []  # column at which a valve's variables begin
        for j, pattern in enumerate(combination):
            first = len(columns)
            self._first.append(first)
            if pattern is None:
                columns += [self._column(j, i, i + 1) for i in range(cost.horizon)]
                if np.isfinite(limits.move[j]):
                    rows += [(first + i, first + i - 1) for i in range(1, cost.horizon)]
            elif pattern.jumps:
                split = pattern.wait + pattern.second if pattern.second else cost.horizon
                columns.append(self._column(j, pattern.wait, split))
                if pattern.second:
                    columns.append(self._column(j, split, cost.horizon))
                    rows.append((first + 1, first))
        empty = np.zeros((cost.horizon * self._width, 0))
        shape = np.array(columns).T if columns else empty
        matrix = np.zeros((len(rows), shape.shape[1]))
        for i, (column, before) in enumerate(rows):
            matrix[i, column], matrix[i, before] = 1.0, -1.0
        self._rows = len(rows)
        # Where the stem of a valve stays until it jumps, and the curvature along that.
        anchors = []
        for j, pattern in enumerate(combination):
            stays = 0
            if pattern is not None:
                stays = cost.horizon if pattern.direction == 0 else pattern.wait
            anchors.append(self._column(j, 0, stays))
        self._anchors = np.array(anchors).T
        self._curved = cost.hessian @ self._anchors
        self._free = np.full((2, shape.shape[1] + len(rows)), FREE)
        self._free[0] = -FREE
        self.qp = HorizonQp(
            cost, np.ascontiguousarray(shape), matrix, limits.output, limits.iterations
        )

    def _column(self, valve: int, first: int, last: int) -> FloatArray:
        column = np.zeros((self._horizon, self._width))
        column[first:last, valve] = 1.0
        return column.reshape(-1)

    def solve(
        self,
        state: FloatArray,
        target: Target,
        valves: StickyState,
        gradient: FloatArray | None = None,
    ) -> HorizonSolution | None:
        """Return the best plan of this combination from ξ̂ (n,), or None.

        ``gradient`` is that of the cost, shape (N m,), where the caller has it already.
        """
        deviation = valves.last - target.stem
        if gradient is None:
            gradient = self.qp.cost.linear(state - target.state, deviation, target.path)
        lower, upper = self._bounds(target, valves)
        return self.qp.solve(
            state - target.state,
            gradient,
            lower,
            upper,
            target.pv,
            self._anchors @ deviation,
            self._curved @ deviation,
        )

    def _bounds(self, target: Target, valves: StickyState) -> tuple[FloatArray, FloatArray]:
        size = self.qp.size
        lower, upper = self._free.copy()
        row = size
        for j, pattern in enumerate(self.combination):
            first = self._first[j]
            low, high = self._limits.stem[j] - target.stem[j]
            if pattern is None:
                last = first + self._horizon
                lower[first:last], upper[first:last] = low, high
                move = self._limits.move[j]
                if np.isfinite(move):
                    start = valves.last[j] - target.stem[j]
                    lower[first], upper[first] = max(low, start - move), min(high, start + move)
                    lower[row : row + self._horizon - 1] = -move
                    upper[row : row + self._horizon - 1] = move
                    row += self._horizon - 1
            elif pattern.jumps:
                sign, least = pattern.direction, valves.least[j]
                # The jump must happen from wherever the stem may be.
                unsure = abs(valves.interval[j, 1 if sign > 0 else 0] - valves.last[j])
                largest = max(valves.largest[j], unsure + least)
                start = valves.last[j] - target.stem[j]
                lower[first], upper[first] = self._jump_bounds(sign, low, high, valves.room[j])
                if sign > 0:
                    lower[first] = max(lower[first], start + unsure + least)
                    upper[first] = min(upper[first], start + largest)
                else:
                    upper[first] = min(upper[first], start - unsure - least)
                    lower[first] = max(lower[first], start - largest)
                if pattern.second:
                    # The second jump starts at a decision variable: a row keeps its size.
                    lower[first + 1], upper[first + 1] = self._jump_bounds(
                        -sign, low, high, valves.room[j]
                    )
                    largest = max(valves.largest[j], least)
                    if sign > 0:
                        lower[row], upper[row] = -largest, -least
                    else:
                        lower[row], upper[row] = least, largest
                    row += 1
        return lower, upper

    def _jump_bounds(self, sign: int, low: float, high: float, room: float) -> tuple[float, float]:
        return (low, high - room) if sign > 0 else (low + room, high)
