"""What each pattern of jumps costs at least, so that few of their programmes need be solved."""

from collections.abc import Sequence

import numpy as np

from stiction_ros.control.embedding_problem import JumpPattern, StickyState
from stiction_ros.control.horizon import HorizonCost
from stiction_ros.effects.behaviour import FloatArray

Combination = tuple[JumpPattern | None, ...]


class PatternBounds:
    r"""Lower bounds on the optimum of every combination of patterns, all in one go.

    Left out are the limits of stems and outputs and the rates of healthy valves, whose moves are
    then eliminated once for all patterns: with H the Hessian of
    :class:`~stiction_ros.control.horizon.HorizonCost`,

    .. math::
        S = H_{ss} - H_{sh} H_{hh}^{-1} H_{hs}.

    What is left is a problem in the sizes of the jumps, each between its least and its largest.
    Its value at any sizes less what its gradient could still gain inside these bounds is a lower
    bound, as the problem is convex; at the optimum nothing is taken off.
    """

    def __init__(self, cost: HorizonCost, combinations: Sequence[Combination]) -> None:
        """Eliminate the moves of healthy valves, note each pattern's jumps, compile the loops."""
        from stiction_ros.control.box_bounds import box_bounds  # compiled: slow to import

        width, horizon = len(combinations[0]), cost.horizon
        healthy = np.array([pattern is None for pattern in combinations[0]])
        jumps = [_jumps(combination) for combination in combinations]
        columns = sorted({(j, at) for found in jumps for j, at, _, _ in found})
        steps = np.zeros((horizon, width, len(columns)))
        for c, (j, at) in enumerate(columns):
            steps[at:, j, c] = 1.0
        rests = np.zeros((horizon, width, width))
        rests[:, ~healthy, ~healthy] = 1.0
        basis = np.concatenate([steps, rests], axis=2).reshape(horizon * width, -1)
        curved = cost.hessian @ basis
        moved = np.tile(healthy, horizon)
        free = cost.hessian[np.ix_(moved, moved)]
        gains = np.linalg.solve(free, curved[moved])
        self._map = basis.T.copy()
        self._map[:, moved] -= gains.T
        self._whole = basis.T @ curved - curved[moved].T @ gains
        self._free = np.linalg.inv(np.linalg.cholesky(free))
        self._moved, self._count = moved, len(columns)
        size = max((len(found) for found in jumps), default=0)
        shape = (len(combinations), max(size, 1))
        self._columns, self._signs = np.zeros(shape, dtype=np.int64), np.zeros(shape)
        self._valves = np.zeros(shape, dtype=np.int64)
        self._kinds = np.zeros(shape, dtype=np.int64)  # 0 first jump up, 1 first one down, 2 later
        self._counts = np.array([len(found) for found in jumps], dtype=np.int64)
        for p, found in enumerate(jumps):
            for k, (j, at, sign, first) in enumerate(found):
                self._columns[p, k], self._signs[p, k] = columns.index((j, at)), sign
                self._valves[p, k] = j
                self._kinds[p, k] = 2 if not first else int(sign < 0)
        self._box_bounds = box_bounds
        self._bounds(np.zeros(self._count), np.zeros(shape), np.ones(shape))

    def of(self, gradient: FloatArray, deviation: FloatArray, valves: StickyState) -> FloatArray:
        """Return a lower bound for every combination, (P,), by gradient and χ̂ − χ_ss, (m,)."""
        linear = self._map @ gradient
        c, whole = self._count, self._whole
        base = deviation @ (0.5 * whole[c:, c:] @ deviation + linear[c:])
        relaxed = self._free @ gradient[self._moved]
        least, largest = jump_sizes(valves)
        found = self._bounds(
            linear[:c] + whole[:c, c:] @ deviation,
            least[self._valves, self._kinds],
            largest[self._valves, self._kinds],
        )
        return np.asarray(found + (base - 0.5 * relaxed @ relaxed))

    def _bounds(self, linear: FloatArray, least: FloatArray, largest: FloatArray) -> FloatArray:
        hessian = np.ascontiguousarray(self._whole[: self._count, : self._count])
        jumps = (self._columns, self._signs, self._counts)
        return self._box_bounds(hessian, linear, jumps, (least, largest))


def jump_sizes(valves: StickyState) -> tuple[FloatArray, FloatArray]:
    """Return least and largest jump, shape (m, 3) each, %: first one up, first one down, later.

    The first must happen from wherever the stem may be.
    """
    least = np.column_stack([valves.least] * 3)
    least[:, 0] += valves.interval[:, 1] - valves.last
    least[:, 1] += valves.last - valves.interval[:, 0]
    return least, np.maximum(valves.largest[:, None], least)


def _jumps(combination: Combination) -> list[tuple[int, int, int, bool]]:
    """Return (valve, sample, sign, whether it is its first) of each jump."""
    found = []
    for j, pattern in enumerate(combination):
        if pattern is None or not pattern.jumps:
            continue
        found.append((j, pattern.wait, pattern.direction, True))
        if pattern.second:
            found.append((j, pattern.wait + pattern.second, -pattern.direction, False))
    return found
