"""The general warm start: a small dynamic optimisation of (22) under He's hard model."""

import dataclasses
import itertools

import daqp
import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.controllers.augmented_cost import (
    AugmentedCost,
    PlanProblem,
    PrintedFriction,
)

LEAST_SLIP = 1e-3  # %; by (4) an error of exactly f_S does not slip
FREE = 1e30
# Samples at which a healthy valve may move; it rests between them.
BLOCKS = (0, 1, 2, 4, 8, 16, 32, 64, 128)
DWELLS = {1: (1, 2, 4), 2: (1, 3), 3: (2,)}  # samples on the way-point, by sticky valves


@dataclasses.dataclass(frozen=True)
class Route:
    """How one sticky valve travels: not at all, at once, or by way of a point beyond."""

    direction: int  # sign of the first move, 0 for staying
    dwell: int = 0  # samples on the way-point before the opposite move, 0 for no way-point


class SearchedStart:
    """The cheapest of a few routes, the sizes of the moves from one small quadratic programme.

    The unknowns are one or two stem positions per sticky valve and a few blocks per healthy
    one. While a sticky valve rests its OP is as near to u_s as friction allows.
    """

    def __init__(self, cost: AugmentedCost, limits: FloatArray) -> None:
        """Factorise one programme per combination of routes; ``limits`` (m, 2), %."""
        self.cost, self.limits = cost, limits
        sticky = [j for j, friction in enumerate(cost.frictions) if friction is not None]
        dwells = DWELLS[min(len(sticky), max(DWELLS))]
        routes = [Route(0)]
        routes += [Route(sign, dwell) for sign in (1, -1) for dwell in (0, *dwells)]
        routes = [route for route in routes if route.dwell < cost.horizon]
        self._programmes = []
        for combination in itertools.product(routes, repeat=len(sticky)):
            chosen = dict(zip(sticky, combination, strict=True))
            self._programmes.append(_RouteProgramme(cost, limits, chosen))

    def find(self, situation: PlanProblem) -> FloatArray | None:
        """Return OP, shape (N, m), % within the limits; None when no route is feasible."""
        best: tuple[float, FloatArray] | None = None
        for programme in self._programmes:
            op = programme.solve(situation)
            if op is None:
                continue
            op = np.clip(op, self.limits[:, 0], self.limits[:, 1])
            cost = self.cost(situation, op)
            if best is None or cost < best[0]:
                best = cost, op
        return None if best is None else best[1]


class _RouteProgramme:
    """(22) for one route per sticky valve, in stems off the target: v = T r + v_0."""

    def __init__(self, cost: AugmentedCost, limits: FloatArray, routes: dict[int, Route]) -> None:
        self._cost, self._limits, self._routes = cost, limits, routes
        m, horizon = len(limits), cost.horizon
        columns: list[FloatArray] = []
        self._first: dict[int, int] = {}  # valve → its first column
        slips = np.zeros((horizon, m))  # sign of the slip
        moving = np.ones((horizon, m), dtype=bool)  # samples whose OP follows the stem
        for j in range(m):
            self._first[j] = len(columns)
            route = routes.get(j)
            if route is None:
                edges = [block for block in BLOCKS if block < horizon]
            else:
                moving[:, j] = False
                edges = [] if route.direction == 0 else [0, route.dwell][: 1 + (route.dwell > 0)]
                for edge, sign in zip(edges, (1, -1), strict=False):
                    slips[edge, j], moving[edge, j] = sign * route.direction, True
            for first, last in itertools.pairwise([*edges, horizon]):
                column = np.zeros((horizon, m))
                column[first:last, j] = 1.0
                columns.append(column.reshape(-1))
        self._shape = np.array(columns).reshape(len(columns), horizon * m).T
        self._slips = slips
        self._hessian, self._op_linear = self._curvature(slips, moving)
        self._solver: daqp.Model | None = None

    def _curvature(self, slips: FloatArray, moving: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the Hessian in v, and the linear term in v that the slips' f_D bring."""
        cost, weights = self._cost, self._cost.weights
        horizon = len(slips)
        later = np.diag(np.append(np.ones(horizon - 1), 0.0))
        hessian = cost.part.hessian + 2.0 * np.kron(later, weights.stem)
        counted = moving.reshape(-1).astype(float)
        penalty = np.kron(np.eye(horizon), weights.op) * np.outer(counted, counted)
        dynamic = np.array([0.0 if f is None else f.dynamic_friction for f in cost.frictions])
        return hessian + 2.0 * penalty, 2.0 * penalty @ (slips * dynamic).reshape(-1)

    def solve(self, situation: PlanProblem) -> FloatArray | None:
        """Return OP over the horizon, shape (N, m), %, or None."""
        target = situation.target
        last = situation.stem - target.stem
        offset = np.zeros((self._cost.horizon, len(last)))
        for j, route in self._routes.items():
            if route.direction == 0:
                offset[:, j] = last[j]
        base = offset.reshape(-1)
        sizes = np.zeros(0)
        if self._shape.shape[1]:
            linear = self._cost.part.linear(situation.state - target.state, last)
            linear = linear + self._op_linear + self._hessian @ base
            found = self._sizes(self._shape.T @ linear, *self._bounds(situation))
            if found is None:
                return None
            sizes = found
        stems = (self._shape @ sizes + base).reshape(offset.shape) + target.stem
        return self._op(stems, target.stem)

    def _sizes(self, linear: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray | None:
        if np.any(lower > upper):
            return None
        if self._solver is None:
            hessian = np.ascontiguousarray(self._shape.T @ self._hessian @ self._shape)
            self._solver = daqp.Model()
            sense = np.zeros(len(lower), dtype=np.int32)
            flag, _ = self._solver.setup(hessian, linear, self._turns(), upper, lower, sense)
        else:
            flag = self._solver.update(f=linear, bupper=upper, blower=lower)
        if flag < 0:
            self._solver = None
            return None
        sizes, _, flag, _ = self._solver.solve()
        if flag < 1:
            self._solver = None
            return None
        return np.asarray(sizes)

    def _turns(self) -> FloatArray:
        """Return one row per way-point: the second stem less the first."""
        rows = []
        for j, route in self._routes.items():
            if route.dwell:
                row = np.zeros(self._shape.shape[1])
                row[self._first[j]], row[self._first[j] + 1] = -1.0, 1.0
                rows.append(row)
        return np.array(rows).reshape(len(rows), self._shape.shape[1])

    def _bounds(self, situation: PlanProblem) -> tuple[FloatArray, FloatArray]:
        """Return bounds on the stems off the target, then on the turns."""
        target = situation.target
        count = self._shape.shape[1]
        owner = self._shape.T.reshape(count, self._cost.horizon, -1).any(axis=1).argmax(axis=1)
        lower = (self._limits[:, 0] - target.stem)[owner]
        upper = (self._limits[:, 1] - target.stem)[owner]
        turns: list[tuple[float, float]] = []
        for j, route in self._routes.items():
            friction = self._cost.frictions[j]
            if friction is None or route.direction == 0:
                continue
            first, least = self._first[j], friction.jump + LEAST_SLIP
            at = situation.stem[j] - target.stem[j]
            for column, sign in zip((first, first + 1), (1, -1), strict=True):
                if column > first and not route.dwell:
                    continue
                # OP = stem ± f_D stays within the limits too.
                if sign * route.direction > 0:
                    upper[column] -= friction.dynamic_friction
                else:
                    lower[column] += friction.dynamic_friction
            if route.direction > 0:
                lower[first] = max(lower[first], at + least)
            else:
                upper[first] = min(upper[first], at - least)
            if route.dwell:
                turns.append((-FREE, -least) if route.direction > 0 else (least, FREE))
        ends = np.array(turns).reshape(len(turns), 2)
        return np.append(lower, ends[:, 0]), np.append(upper, ends[:, 1])

    def _op(self, stems: FloatArray, goal: FloatArray) -> FloatArray:
        """Return OP that makes ``stems``: f_D beyond on a slip, near u_s at rest."""
        op = stems.copy()
        for j in self._routes:
            friction: PrintedFriction | None = self._cost.frictions[j]
            if friction is None:
                continue
            reach = max(friction.static_friction - LEAST_SLIP, 0.0)
            rest = np.clip(goal[j], stems[:, j] - reach, stems[:, j] + reach)
            slips = self._slips[:, j]
            moved = stems[:, j] + slips * friction.dynamic_friction
            op[:, j] = np.where(slips == 0.0, rest, moved)
        return op
