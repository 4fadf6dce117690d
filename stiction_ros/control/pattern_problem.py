"""One quadratic programme of (19): sticky valves move by given patterns, others at every sample."""

import dataclasses
import functools
import itertools
from collections.abc import Sequence

import numpy as np

from stiction_ros.control.horizon import HorizonCost, HorizonLimits
from stiction_ros.control.horizon_qp import HorizonQp, HorizonSolution
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray


@dataclasses.dataclass(frozen=True)
class JumpPattern:
    """Moves of one sticky valve: none, one jump, or a second opposite one later."""

    direction: int  # sign of the first jump, 0 for staying
    second: int = 0  # samples from the first jump to the opposite one, 0 for none
    wait: int = 0  # samples before the first jump

    @property
    def jumps(self) -> tuple[tuple[int, int], ...]:
        """Sample and sign of each jump, 0 to 2 of them."""
        later = [(self.wait + self.second, -self.direction)] if self.second else []
        return ((self.wait, self.direction), *later) if self.direction else ()


Combination = tuple[JumpPattern | None, ...]  # of each valve, None for a healthy one


@dataclasses.dataclass(frozen=True)
class StickyState:
    """What a problem must know of the valves now: of healthy ones only where they are."""

    last: FloatArray  # stem estimates χ̂, shape (m,), %
    interval: FloatArray  # lowest and highest stem position that is possible, shape (m, 2), %
    least: FloatArray  # least, largest: jump with margin, shape (m,), %; the least is allowed
    largest: FloatArray
    room: FloatArray  # distance of a jumping stem from the limits, for OP's sake, (m,), %

    @functools.cached_property
    def jump_sizes(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest jump, shape (m, 3) each, %: first one up, first one down, later.

        The first must happen from wherever the stem may be.
        """
        least = np.column_stack([self.least] * 3)
        least[:, 0] += self.interval[:, 1] - self.last
        least[:, 1] += self.last - self.interval[:, 0]
        return least, np.maximum(self.largest[:, None], least)


class Stems:
    """The decision variables: of each valve its stem, off the target, from samples of moves on.

    A valve without friction may move at every sample, within its rate limit.

    Attributes:
        first: column of the first variable of each valve, and behind the last one.
        shape: T of :class:`~.horizon_qp.HorizonQp`, shape (N m, r).
        rates: rows of the rate limits, shape (c, r).
    """

    def __init__(
        self, horizon: int, limits: HorizonLimits, samples: Sequence[Sequence[int] | None]
    ) -> None:
        """Lay out columns by the samples at which each valve may move, None for all of them."""
        moves = [range(horizon) if of is None else of for of in samples]
        self.first = [0, *itertools.accumulate(map(len, moves))]
        shape = np.zeros((horizon, len(moves), self.first[-1]))
        for j, of in enumerate(moves):
            for column, (begin, end) in enumerate(itertools.pairwise([*of, horizon])):
                shape[begin:end, j, self.first[j] + column] = 1.0
        self.shape = shape.reshape(horizon * len(moves), self.first[-1])
        self._limits = limits
        healthy = [j for j, of in enumerate(samples) if of is None]
        self._limited = [j for j in healthy if np.isfinite(limits.move[j])]
        rated = [k for j in self._limited for k in range(self.first[j] + 1, self.first[j + 1])]
        self.rates = self.moves(rated)
        counts = [*map(len, moves), len(rated)]
        self._ends = np.repeat(np.vstack([limits.stem, [0.0, 0.0]]), counts, axis=0).T.copy()
        self._ends[:, self.first[-1] :] = np.outer(
            (-1.0, 1.0), np.repeat(limits.move[self._limited], horizon - 1)
        )
        self._valves = np.repeat(np.arange(len(counts)), counts)

    def moves(self, columns: Sequence[int]) -> FloatArray:
        """Return the rows of the moves to some variables from those before them."""
        eye = np.eye(self.first[-1])
        return eye[list(columns)] - eye[[column - 1 for column in columns]]

    def bounds(self, target: Target, last: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the bounds on the variables and then on the rates, by the last stems, (m,)."""
        lower, upper = self._ends - np.append(target.stem, 0.0)[self._valves]
        for j in self._limited:
            k, start, move = self.first[j], last[j] - target.stem[j], self._limits.move[j]
            lower[k], upper[k] = max(lower[k], start - move), min(upper[k], start + move)
        return lower, upper


class PatternProblem:
    """(19) for one combination of jump patterns; without a sticky valve it is (19) itself.

    Attributes:
        jumps: number of jumps of all valves.
        qp: the programme in the variables of :class:`Stems`.
    """

    def __init__(self, cost: HorizonCost, limits: HorizonLimits, combination: Combination) -> None:
        """Factorise for ``combination``."""
        jumps = [None if pattern is None else pattern.jumps for pattern in combination]
        self.jumps = sum(map(len, filter(None, jumps)))
        self._stems = Stems(
            cost.horizon, limits, [of if of is None else [at for at, _ in of] for of in jumps]
        )
        self._jumping = [(j, of) for j, of in enumerate(jumps) if of]
        seconds = [self._stems.first[j] + 1 for j, of in self._jumping if len(of) > 1]
        # Where the stem of a valve stays until it jumps, and the curvature along that.
        anchors = np.zeros((cost.horizon, len(jumps), len(jumps)))
        for j, of in enumerate(jumps):
            if of is not None:
                anchors[: of[0][0] if of else None, j, j] = 1.0
        self._anchors = anchors.reshape(-1, len(jumps))
        self._curved = cost.hessian @ self._anchors
        rows = np.vstack([self._stems.rates, self._stems.moves(seconds)])
        self.qp = HorizonQp(cost, self._stems.shape, rows, limits.output, limits.iterations)

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
        lower, upper = self._stems.bounds(target, valves.last)
        seconds = []
        for j, jumps in self._jumping:
            first, sizes = self._stems.first[j], np.stack(valves.jump_sizes, axis=-1)[j]
            for k, (_, sign) in enumerate(jumps, first):
                if sign > 0:
                    upper[k] -= valves.room[j]
                else:
                    lower[k] += valves.room[j]
            sign = jumps[0][1]
            start = valves.last[j] - target.stem[j]
            ends = start + sign * sizes[0 if sign > 0 else 1]
            lower[first], upper[first] = max(lower[first], min(ends)), min(upper[first], max(ends))
            if len(jumps) > 1:  # it starts at a decision variable: a row keeps its size
                seconds.append(np.sort(-sign * sizes[2]))
        if not seconds:
            return lower, upper
        rows = np.array(seconds)
        return np.append(lower, rows[:, 0]), np.append(upper, rows[:, 1])
