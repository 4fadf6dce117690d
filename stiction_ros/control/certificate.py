"""How far a plan of the embedding is from the best that any pattern of jumps can do."""

from collections.abc import Sequence

import daqp
import numpy as np

from stiction_ros.control.embedding_problem import FREE, StickyState
from stiction_ros.control.horizon import HorizonCost, HorizonLimits
from stiction_ros.control.horizon_qp import HorizonQp
from stiction_ros.control.pattern_bounds import jump_sizes
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray

BINARY = 16  # a bound of daqp that must be active on one side
CURVATURE = 1e-3  # of the binaries; their linear terms take it off at 0 and 1
ITERATION_LIMIT = 2_000_000


class FreeJumps:
    r"""The embedding with jumps of any number and direction, solved by branch and bound.

    At each of the first ``samples`` samples every sticky valve stays, jumps up or jumps down,
    told by two binaries δ⁺, δ⁻ with δ⁺ + δ⁻ ≤ 1:

    .. math::
        (J + \text{margin}) \delta^+ - M \delta^- \le \Delta\chi
            \le M \delta^+ - (J + \text{margin}) \delta^-,

    M the largest jump that is allowed, or the whole travel.

    Later no sticky valve moves. Everything else (bounds, weights, prices, slacks) is as in
    :class:`~.embedding.EmbeddingMpc`. The time grows by about a third with each further sample.

    Columns: stems of sticky valves at the free samples, healthy stems, then binaries.
    """

    def __init__(
        self,
        cost: HorizonCost,
        limits: HorizonLimits,
        valves: StickyState,
        sticky: Sequence[bool],
        jump_price: float,
        samples: int,
    ) -> None:
        """Lay out columns and rows; ``jump_price`` is added for each jump in 1 … N ``samples``."""
        self.cost, self.limits, self.valves = cost, limits, valves
        self.jump_price, self.samples = jump_price, min(samples, cost.horizon)
        self._is_sticky = tuple(sticky)
        self.width = len(self._is_sticky)
        self.sticky = [j for j, one in enumerate(self._is_sticky) if one]
        columns: list[FloatArray] = []
        self.first: list[int] = []
        for j, one in enumerate(self._is_sticky):
            self.first.append(len(columns))
            count = self.samples if one else cost.horizon
            for i in range(count):
                column = np.zeros((cost.horizon, self.width))
                column[i : i + 1 if i < count - 1 else None, j] = 1.0
                columns.append(column.reshape(-1))
        self.stems = len(columns)
        binaries = 2 * self.samples * len(self.sticky)
        self.size = self.stems + binaries
        shape = np.zeros((cost.horizon * self.width, self.size))
        shape[:, : self.stems] = np.array(columns).T
        rows = np.vstack([self._rates(), self._jumps()])
        self.qp = HorizonQp(cost, shape, rows, limits.output)

    def _rates(self) -> FloatArray:
        rows = []
        for j, sticky in enumerate(self._is_sticky):
            if not sticky and np.isfinite(self.limits.move[j]):
                for i in range(1, self.cost.horizon):
                    row = np.zeros(self.size)
                    row[self.first[j] + i], row[self.first[j] + i - 1] = 1.0, -1.0
                    rows.append(row)
        return np.array(rows).reshape(-1, self.size)

    def _jumps(self) -> FloatArray:
        """Return five rows per sticky valve and sample."""
        rows = []
        valves = self.valves
        for number, j in enumerate(self.sticky):
            travel = float(np.diff(self.limits.stem[j])[0])
            least, largest = (sizes[j] for sizes in jump_sizes(valves))
            for i in range(self.samples):
                binary = self.stems + 2 * (number * self.samples + i)
                move = np.zeros(self.size)
                move[self.first[j] + i] = 1.0
                if i:
                    move[self.first[j] + i - 1] = -1.0
                kinds = (0, 1) if i == 0 else (2, 2)  # up and down
                up, down = (min(travel, largest[kind]) for kind in kinds)
                upper, lower, one = move.copy(), move.copy(), np.zeros(self.size)
                upper[binary : binary + 2] = -up, least[kinds[1]]
                lower[binary : binary + 2] = -least[kinds[0]], down
                one[binary : binary + 2] = 1.0
                high, low = np.zeros(self.size), np.zeros(self.size)
                high[self.first[j] + i] = low[self.first[j] + i] = 1.0
                high[binary], low[binary + 1] = valves.room[j], -valves.room[j]
                rows += [upper, lower, one, high, low]
        return np.array(rows).reshape(-1, self.size)

    def optimum(self, state: FloatArray, target: Target) -> float | None:
        """Return the least cost from ξ̂, (n,), in the units of (19a); None where it is not found.

        A sticky valve without limits has no big M.
        """
        if not np.isfinite(self.limits.stem[self.sticky]).all():
            return None
        lower, upper = self._bounds(target)
        z, deviation = state - target.state, self.valves.last - target.stem
        problem, linear = self.qp.problem(z, deviation, lower, upper, target.pv, target.path)
        hessian = problem.hessian.copy()
        binaries = np.arange(self.stems, self.size)
        hessian[binaries, binaries] += CURVATURE
        linear[binaries] += self.jump_price - 0.5 * CURVATURE
        sense = np.zeros(len(problem.upper), dtype=np.int32)
        sense[binaries] = BINARY
        _, value, flag, _ = daqp.solve(
            hessian,
            linear,
            problem.matrix,
            problem.upper,
            problem.lower,
            sense,
            iter_limit=ITERATION_LIMIT,
        )
        if flag < 1:
            return None
        return float(value) + self.cost.constant(z, deviation, target.path)

    def _bounds(self, target: Target) -> tuple[FloatArray, FloatArray]:
        limits, horizon = self.limits, self.cost.horizon
        lower, upper = np.zeros(self.size), np.ones(self.size)
        row_lower: list[float] = []
        row_upper: list[float] = []
        jump_lower: list[float] = []
        jump_upper: list[float] = []
        for j, sticky in enumerate(self._is_sticky):
            low, high = limits.stem[j] - target.stem[j]
            first = self.first[j]
            start = float(self.valves.last[j] - target.stem[j])
            if sticky:
                lower[first : first + self.samples] = low
                upper[first : first + self.samples] = high
                for i in range(self.samples):
                    origin = 0.0 if i else start
                    jump_lower += [-FREE, origin, -FREE, -FREE, low]
                    jump_upper += [origin, FREE, 1.0, high, FREE]
                continue
            lower[first : first + horizon], upper[first : first + horizon] = low, high
            move = limits.move[j]
            if np.isfinite(move):
                lower[first], upper[first] = max(low, start - move), min(high, start + move)
                row_lower += [-move] * (horizon - 1)
                row_upper += [move] * (horizon - 1)
        return (
            np.concatenate([lower, row_lower, jump_lower]),
            np.concatenate([upper, row_upper, jump_upper]),
        )
