"""The condensed problem (19) for one pattern of moves, solved by daqp."""

import dataclasses
import functools

import daqp
import numpy as np

from stiction_ros.control.horizon import ITERATION_LIMIT, HorizonCost
from stiction_ros.effects.behaviour import FloatArray

SLACK_WEIGHT = 1e4  # of slack², relative to what the whole horizon gains per squared PV
OUT_OF_ITERATIONS = -4  # exit flag of daqp


@dataclasses.dataclass(frozen=True)
class HorizonSolution:
    """A plan of one pattern of moves."""

    plan: FloatArray  # stems in deviations from the target, shape (N, m)
    cost: float  # of the plan
    slack: FloatArray  # by how much outputs break their soft bounds at most, shape (p,)


class Programme:
    """min x'Hx/2 + f'x with bounds on x and then on the rows A x; only vectors change."""

    def __init__(self, hessian: FloatArray, matrix: FloatArray, iterations: int) -> None:
        self.hessian = np.ascontiguousarray(hessian)
        self.matrix = np.ascontiguousarray(matrix)
        count = len(hessian) + len(matrix)
        self.lower, self.upper = np.full(count, -1e30), np.full(count, 1e30)
        self.limit_reached = False
        self._iterations = iterations
        self._model, self._ready = daqp.Model(), False

    def solve(self, linear: FloatArray) -> tuple[FloatArray, float] | None:
        """Return x and the optimum within ``lower`` and ``upper``, or None, and begin anew."""
        self.limit_reached = False
        if self._load(linear) < 0:
            self._ready = False
            return None
        solution, value, flag, _ = self._model.solve()
        if flag < 1 or not np.isfinite(value):
            self._ready, self.limit_reached = False, flag == OUT_OF_ITERATIONS
            return None
        return solution, float(value)

    def _load(self, linear: FloatArray) -> int:
        if self._ready:
            return int(self._model.update(f=linear, bupper=self.upper, blower=self.lower))
        self._model = daqp.Model()
        sense = np.zeros(len(self.upper), dtype=np.int32)
        flag, _ = self._model.setup(
            self.hessian, linear, self.matrix, self.upper, self.lower, sense
        )
        self._model.settings = {"iter_limit": self._iterations}
        self._ready = flag >= 0
        return int(flag)


class HorizonQp:
    """(19) over plans v = T r + v₀ with r the decision variables of one pattern of moves.

    The matrices are factorised once; each :meth:`solve` changes vectors only. Soft bounds are
    left out at first: a plan that breaks none without them is the optimum with them, too.
    """

    def __init__(
        self,
        cost: HorizonCost,
        shape: FloatArray,
        rows: FloatArray,
        output_bounds: FloatArray,
        iterations: int = ITERATION_LIMIT,
    ) -> None:
        """Set up.

        Args:
            cost: the condensed cost.
            shape: T, shape (N m, r).
            rows: further constraint rows on r, shape (c, r).
            output_bounds: soft bounds (p, 2); rows are added only where one is finite.
            iterations: most iterations of one solve.
        """
        self.cost, self.shape = cost, shape
        self._iterations = iterations
        self.limit_reached = False  # whether the last solve ended for want of iterations
        self.size = shape.shape[1]
        self._bounded = np.flatnonzero(np.isfinite(output_bounds).any(axis=1))
        self._output_bounds = output_bounds[self._bounded]
        # Of each output's squared slack, halved in the cost.
        reach = (cost.forced_output**2).sum(axis=(0, 2))
        scale = float(np.trace(cost.hessian)) / np.maximum(reach, 1e-300)
        self._slack_weight = (SLACK_WEIGHT * cost.horizon * scale)[self._bounded]
        self._hard = Programme(shape.T @ cost.hessian @ shape, rows, iterations)

    @functools.cached_property
    def _soft(self) -> Programme:
        """The programme with soft bounds: a slack more for each bounded output."""
        size, slacks, horizon = self.size, len(self._bounded), self.cost.horizon
        hessian = np.zeros((size + slacks, size + slacks))
        hessian[:size, :size] = self._hard.hessian
        hessian[size:, size:] = np.diag(self._slack_weight)
        rows = self._hard.matrix
        blocks = [np.hstack([rows, np.zeros((len(rows), slacks))])]
        output_rows = self.cost.forced_output[:, self._bounded] @ self.shape  # (N, s, r)
        for sign in (1.0, -1.0):
            block = np.zeros((horizon, slacks, size + slacks))
            block[..., :size] = output_rows
            block[:, range(slacks), range(size, size + slacks)] = -sign
            blocks.append(block.reshape(horizon * slacks, size + slacks))
        programme = Programme(hessian, np.vstack(blocks), self._iterations)
        programme.lower[size : size + slacks] = 0.0
        return programme

    def solve(
        self,
        state: FloatArray,
        gradient: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        target_pv: FloatArray,
        offset: FloatArray,
        curved: FloatArray,
    ) -> HorizonSolution | None:
        """Return the best plan, or None when there is none.

        Args:
            state: ξ̂ − ξ_ss, shape (n,).
            gradient: by :meth:`HorizonCost.linear`, shape (N m,).
            lower, upper: bounds on r and then on the further rows, shape (r + c,).
            target_pv: outputs at the target, shape (p,), about which soft bounds are written.
            offset: v₀, shape (N m,).
            curved: H v₀, shape (N m,).
        """
        self.limit_reached = False
        base = float(offset @ (0.5 * curved + gradient))
        linear = self.shape.T @ (gradient + curved)
        if (lower > upper).any():
            return None
        if self.size == 0:
            plan = offset.reshape(self.cost.horizon, -1)  # nothing is left to decide
            slack = self.slack(state, plan, target_pv)
            price = 0.5 * float(self._slack_weight @ slack[self._bounded] ** 2)
            return HorizonSolution(plan, base + price, slack)
        self._hard.lower[:], self._hard.upper[:] = lower, upper
        found = self._solved(self._hard, linear)
        if found is None:
            return None
        variables, value = found
        plan = (self.shape @ variables + offset).reshape(self.cost.horizon, -1)
        slack = np.zeros(len(target_pv))
        if len(self._bounded) and self.slack(state, plan, target_pv).any():
            self._fill_bounds(state, offset, lower, upper, target_pv)
            found = self._solved(self._soft, np.append(linear, np.zeros(len(self._bounded))))
            if found is None:
                return None
            variables, value = found[0][: self.size], found[1]
            slack[self._bounded] = found[0][self.size :]
            plan = (self.shape @ variables + offset).reshape(self.cost.horizon, -1)
        return HorizonSolution(plan, value + base, slack)

    def _solved(self, programme: Programme, linear: FloatArray) -> tuple[FloatArray, float] | None:
        found = programme.solve(linear)
        self.limit_reached = programme.limit_reached
        return found

    def problem(
        self,
        state: FloatArray,
        last: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        target_pv: FloatArray,
        path: FloatArray | None = None,
    ) -> tuple[Programme, FloatArray]:
        """Return the problem with its soft bounds and its linear terms, without an offset."""
        linear = np.zeros(self.size + len(self._bounded))
        linear[: self.size] = self.shape.T @ self.cost.linear(state, last, path)
        self._fill_bounds(state, np.zeros(len(self.shape)), lower, upper, target_pv)
        return self._soft, linear

    def slack(self, state: FloatArray, plan: FloatArray, target_pv: FloatArray) -> FloatArray:
        """Return by how much ``plan`` (N, m) breaks the soft bounds, shape (p,)."""
        pv = (self.cost.outputs(state, plan) + target_pv)[:, self._bounded]
        beyond = np.maximum(pv - self._output_bounds[:, 1], self._output_bounds[:, 0] - pv)
        slack = np.zeros(len(target_pv))
        slack[self._bounded] = np.maximum(beyond, 0.0).max(axis=0, initial=0.0)
        return slack

    def _fill_bounds(
        self,
        state: FloatArray,
        offset: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        target_pv: FloatArray,
    ) -> None:
        soft, r, s = self._soft, self.size, len(self._bounded)
        rows = len(lower) - r
        soft.lower[:r], soft.upper[:r] = lower[:r], upper[:r]
        soft.lower[r + s : r + s + rows] = lower[r:]
        soft.upper[r + s : r + s + rows] = upper[r:]
        if s:
            free = (self.cost.outputs(state, offset) + target_pv)[:, self._bounded]
            first = r + s + rows
            count = free.size
            high = np.minimum(self._output_bounds[:, 1] - free, 1e30)
            low = np.maximum(self._output_bounds[:, 0] - free, -1e30)
            soft.upper[first : first + count] = high.reshape(-1)
            soft.lower[first + count : first + 2 * count] = low.reshape(-1)
