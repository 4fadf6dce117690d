"""How far a plan of the embedding is from the best that any pattern of jumps can do."""

import dataclasses
from collections.abc import Sequence

import daqp
import numpy as np

from stiction_ros.control.horizon import HorizonCost, HorizonLimits
from stiction_ros.control.horizon_qp import HorizonQp
from stiction_ros.control.pattern_problem import Stems, StickyState
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray

BINARY = 16  # a bound of daqp that must be active on one side
CURVATURE = 1e-3  # of the binaries; their linear terms take it off at 0 and 1
FREE = 1e30
ITERATION_LIMIT = 2_000_000


@dataclasses.dataclass(frozen=True)
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

    The variables are those of :class:`~.pattern_problem.Stems`, then binaries.
    """

    cost: HorizonCost
    limits: HorizonLimits
    valves: StickyState
    sticky: Sequence[int]  # valves, by their numbers
    jump_price: float  # added for each jump
    samples: int  # 1 … N that are free

    def optimum(self, state: FloatArray, target: Target) -> float | None:
        """Return the least cost from ξ̂, (n,), in the units of (19a); None where it is not found.

        A sticky valve without limits has no big M.
        """
        travel = np.diff(self.limits.stem)[:, 0]
        if not np.isfinite(travel[list(self.sticky)]).all():
            return None
        free, m = range(min(self.samples, self.cost.horizon)), len(travel)
        stems = Stems(
            self.cost.horizon, self.limits, [free if j in self.sticky else None for j in range(m)]
        )
        pairs = len(free) * len(self.sticky)  # of binaries
        more = np.zeros((1, 2 * pairs))
        shape, rates = (
            np.hstack([part, np.repeat(more, len(part), axis=0)])
            for part in (stems.shape, stems.rates)
        )
        lower, upper = stems.bounds(target, self.valves.last)
        rows, lows, highs = self._jumps(stems, target, len(free))
        qp = HorizonQp(self.cost, shape, np.vstack([rates, rows]), self.limits.output)
        size = stems.first[-1]
        lower = np.concatenate([lower[:size], more[0], lower[size:], lows])
        upper = np.concatenate([upper[:size], more[0] + 1.0, upper[size:], highs])
        z, deviation = state - target.state, self.valves.last - target.stem
        problem, linear = qp.problem(z, deviation, lower, upper, target.pv, target.path)
        hessian = problem.hessian.copy()
        binaries = np.arange(size, qp.size)
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

    def _jumps(
        self, stems: Stems, target: Target, samples: int
    ) -> tuple[FloatArray, list[float], list[float]]:
        """Return five rows per sticky valve and sample, and their bounds."""
        rows, lows, highs = [], list[float](), list[float]()
        count = 2 * samples * len(self.sticky)
        one = np.eye(stems.first[-1] + count)
        binary = stems.first[-1]
        for j in self.sticky:
            low, high = self.limits.stem[j] - target.stem[j]
            travel = float(np.diff(self.limits.stem[j])[0])
            least, largest = (sizes[j] for sizes in self.valves.jump_sizes)
            largest, room = np.minimum(largest, travel), self.valves.room[j]
            for i in range(samples):
                stem, up, down = one[stems.first[j] + i], one[binary], one[binary + 1]
                first, last = (0, 1) if i == 0 else (2, 2)  # kinds of a jump up and of one down
                move = stem - (one[stems.first[j] + i - 1] if i else 0.0)
                origin = 0.0 if i else float(self.valves.last[j] - target.stem[j])
                rows += [
                    move - largest[first] * up + least[last] * down,
                    move - least[first] * up + largest[last] * down,
                    up + down,
                    stem + room * up,
                    stem - room * down,
                ]
                lows += [-FREE, origin, -FREE, -FREE, low]
                highs += [origin, FREE, 1.0, high, FREE]
                binary += 2
        return np.reshape(rows, (-1, len(one))), lows, highs
