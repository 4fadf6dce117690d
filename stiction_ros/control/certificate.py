"""How far a plan of the embedding is from the best that any pattern of jumps can do."""

import dataclasses
import enum
from collections.abc import Sequence

import daqp
import numpy as np

from stiction_ros.control.embedding_problem import FREE, StickyState
from stiction_ros.control.horizon import HorizonCost, HorizonLimits
from stiction_ros.control.horizon_qp import HorizonQp
from stiction_ros.control.pattern_bounds import jump_sizes
from stiction_ros.control.result import Plan
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray

BINARY = 16  # a bound of daqp that must be active on one side
CURVATURE = 1e-3  # of the binaries; their linear terms take it off at 0 and 1
ITERATION_LIMIT = 2_000_000


class CertificateStatus(enum.StrEnum):
    """Whether the mixed-integer optimum was found."""

    CERTIFIED = "certified"
    UNSOLVED = "unsolved"  # branch and bound found none within its limits
    UNBOUNDED_TRAVEL = "unbounded_travel"  # a sticky valve without limits has no big M


@dataclasses.dataclass(frozen=True)
class Certificate:
    """The mixed-integer optimum beside a plan."""

    status: CertificateStatus  # whether the optimum is known
    optimum: float  # its cost, in the units of (19a), NaN when not known
    gap: float  # cost of the plan above it as a share of it; not below 0; NaN when not known
    samples: int  # of the horizon in which jumps were free
    nodes: int  # of the search tree


def certify(problem: "FreeJumps", state: FloatArray, target: Target, plan: Plan) -> Certificate:
    """Return how far ``plan``, made at ``state`` and ``target``, is from the optimum."""
    nan = float("nan")
    if not problem.bounded:
        return Certificate(CertificateStatus.UNBOUNDED_TRAVEL, nan, nan, problem.samples, 0)
    value, nodes = problem.solve(state, target)
    if value is None:
        return Certificate(CertificateStatus.UNSOLVED, nan, nan, problem.samples, nodes)
    cost, last = problem.cost, problem.valves.last
    fixed = cost.constant(state - target.state, last - target.stem, target.path)
    optimum = value + fixed
    above = max(plan.cost - optimum, 0.0)
    gap = above / max(optimum, 1e-9 * (1.0 + abs(fixed)))
    return Certificate(CertificateStatus.CERTIFIED, optimum, gap, problem.samples, nodes)


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

    @property
    def bounded(self) -> bool:
        """Whether every sticky valve has limits: a big M needs them."""
        return bool(np.isfinite(self.limits.stem[self.sticky]).all())

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

    def solve(self, state: FloatArray, target: Target) -> tuple[float | None, int]:
        """Return the optimum from ξ̂, (n,), without the cost's constant part, and the nodes."""
        lower, upper = self._bounds(target)
        deviation = self.valves.last - target.stem
        problem = self.qp.problem(
            state - target.state, deviation, lower, upper, target.pv, target.path
        )
        hessian, linear = problem.hessian.copy(), problem.linear.copy()
        binaries = np.arange(self.stems, self.size)
        hessian[binaries, binaries] += CURVATURE
        linear[binaries] += self.jump_price - 0.5 * CURVATURE
        sense = np.zeros(len(problem.upper), dtype=np.int32)
        sense[binaries] = BINARY
        _, value, flag, info = daqp.solve(
            hessian,
            linear,
            problem.matrix,
            problem.upper,
            problem.lower,
            sense,
            iter_limit=ITERATION_LIMIT,
        )
        return (float(value) if flag >= 1 else None), int(info["nodes"])

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
