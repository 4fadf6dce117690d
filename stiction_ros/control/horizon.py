"""The finite-horizon problem (19), condensed to the stem moves and solved by daqp."""

from __future__ import annotations

import dataclasses

import daqp
import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.processes import LinearModel

SLACK_WEIGHT = 1e4  # of slack², relative to what the whole horizon gains per squared PV
ITERATION_LIMIT = 2000
OUT_OF_ITERATIONS = -4  # exit flag of daqp


@dataclasses.dataclass(frozen=True)
class HorizonWeights:
    """Penalties of (19a).

    Attributes:
        horizon: N_H, samples.
        state: Q, shape (n, n).
        move: S, shape (m, m), on Δχ (which is Δu for valves without friction).
        terminal: V_F, shape (n, n).
    """

    horizon: int
    state: FloatArray
    move: FloatArray
    terminal: FloatArray


@dataclasses.dataclass(frozen=True)
class HorizonLimits:
    """Bounds of (19e): stems (m, 2) in %, moves (m,) in % per sample, soft outputs (p, 2).

    ``iterations`` is how many the solver may take for one problem.
    """

    stem: FloatArray
    move: FloatArray
    output: FloatArray
    iterations: int = ITERATION_LIMIT


class HorizonCost:
    r"""The cost (19a) as a quadratic in the stacked stems v_i = χ_i − χ_ss.

    With z = ξ − ξ_ss the dynamics are z_{i+1} = A z_i + B v_i, so

    .. math:: J(v) = v^T H v / 2 + v^T (F_z z_0 + F_v v_{-1}) + \text{const}.

    With a preview of the set-points z_i is measured from the path of the steady states,
    z_i − r_i, which adds a linear term. The constant is kept (:meth:`constant`), so that
    costs of different plans compare.
    """

    def __init__(self, model: LinearModel, weights: HorizonWeights) -> None:
        """Condense over ``weights.horizon`` samples."""
        self.model = model
        self.horizon = weights.horizon
        n, m, horizon = model.order, model.b.shape[1], weights.horizon
        free = np.empty((horizon, n, n))
        forced = np.zeros((horizon, n, horizon * m))
        power = np.eye(n)
        for i in range(horizon):
            if i:
                forced[i] = model.a @ forced[i - 1]
            forced[i][:, i * m : (i + 1) * m] = model.b
            power = model.a @ power
            free[i] = power
        penalties = np.repeat(weights.state[None], horizon, axis=0)
        penalties[-1] = weights.terminal
        weighted = penalties @ forced
        hessian = np.tensordot(forced, weighted, axes=([0, 1], [0, 1]))
        self.from_state = np.tensordot(weighted, free, axes=([0, 1], [0, 1])) * 2.0
        self._from_path = -2.0 * weighted  # (N, n, N m)
        difference = np.eye(horizon * m) - np.eye(horizon * m, k=-m)
        moves = np.kron(np.eye(horizon), weights.move)
        hessian = 2.0 * (hessian + difference.T @ moves @ difference)
        self.hessian = 0.5 * (hessian + hessian.T)
        self.from_last = np.zeros((horizon * m, m))
        self.from_last[:m] = -2.0 * weights.move
        self._weights, self._free, self._penalties = weights, free, penalties
        self._constant_state = weights.state + np.einsum("ija,ijk,ikb->ab", free, penalties, free)
        self.free_output = model.c @ free  # (N, p, n)
        self.forced_output = model.c @ forced  # (N, p, N m)

    def linear(
        self, state: FloatArray, last: FloatArray, path: FloatArray | None = None
    ) -> FloatArray:
        """Return F_z z₀ + F_v v₋₁ for deviations ``state`` (n,) and ``last`` (m,).

        ``path`` is r₁ … r_N (or more), shape (N, n), where the steady state moves.
        """
        linear = self.from_state @ state + self.from_last @ last
        if path is not None:
            ahead = path[: self.horizon]
            linear = linear + np.tensordot(self._from_path, ahead, axes=([0, 1], [0, 1]))
        return np.asarray(linear)

    def constant(
        self, state: FloatArray, last: FloatArray, path: FloatArray | None = None
    ) -> float:
        """Return the part of the cost that no plan changes."""
        weights = self._weights
        moves = last @ weights.move @ last
        if path is None:
            return float(state @ self._constant_state @ state + moves)
        free = self._free @ state - path[: self.horizon]
        ahead = np.einsum("ia,iab,ib->", free, self._penalties, free)
        now = state - path[0]
        return float(ahead + now @ weights.state @ now + moves)

    def outputs(self, state: FloatArray, plan: FloatArray) -> FloatArray:
        """Return output deviations from the target, shape (N, p), for samples 1 … N."""
        free = self.free_output.reshape(-1, len(state)) @ state  # one product, not one a sample
        free += self.forced_output.reshape(len(free), -1) @ plan.reshape(-1)
        return np.asarray(free.reshape(self.horizon, -1))


@dataclasses.dataclass(frozen=True)
class HorizonSolution:
    """A plan, stems in deviations from the target, shape (N, m); its cost; the largest slack."""

    plan: FloatArray
    cost: float
    slack: FloatArray
    variables: FloatArray


@dataclasses.dataclass(frozen=True)
class SharedTerms:
    """Products that several programmes of one step share.

    Attributes:
        gradient: of :meth:`HorizonCost.linear`, shape (N m,).
        curved: Hessian times the offset, shape (N m,).
    """

    gradient: FloatArray
    curved: FloatArray


@dataclasses.dataclass(frozen=True)
class QpData:
    """min x'Hx/2 + f'x with bounds on x and then on the rows A x, as daqp takes it."""

    hessian: FloatArray
    linear: FloatArray
    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray


class HorizonQp:
    """(19) over plans v = T r + v₀ with r the decision variables of one pattern of moves.

    The matrices are factorised once; each :meth:`solve` changes vectors only.
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
        slacks = len(self._bounded)
        hessian = np.zeros((self.size + slacks, self.size + slacks))
        core = shape.T @ cost.hessian @ shape
        hessian[: self.size, : self.size] = core
        horizon = cost.horizon
        # The same for every pattern of moves, or their costs would not compare.
        reach = (cost.forced_output[:, self._bounded] ** 2).sum(axis=(0, 2))
        scale = float(np.trace(cost.hessian)) / np.maximum(reach, 1e-300)
        self._slack_weight = SLACK_WEIGHT * horizon * scale
        hessian[self.size :, self.size :] = np.diag(self._slack_weight)
        blocks = [np.hstack([rows, np.zeros((len(rows), slacks))])]
        self._output_rows = cost.forced_output[:, self._bounded] @ shape  # (N, s, r)
        for sign in (1.0, -1.0):
            block = np.zeros((horizon, slacks, self.size + slacks))
            block[..., : self.size] = self._output_rows
            block[:, range(slacks), range(self.size, self.size + slacks)] = -sign
            blocks.append(block.reshape(horizon * slacks, self.size + slacks))
        self._matrix = np.ascontiguousarray(np.vstack(blocks))
        self._slacks = slacks
        count = self.size + slacks + len(self._matrix)
        self._upper, self._lower = np.full(count, 1e30), np.full(count, -1e30)
        self._lower[self.size : self.size + slacks] = 0.0
        self._model = daqp.Model()
        self._hessian = np.ascontiguousarray(hessian)
        self._ready = False

    def solve(
        self,
        state: FloatArray,
        last: FloatArray,
        offset: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        target_pv: FloatArray,
        path: FloatArray | None = None,
        shared: SharedTerms | None = None,
    ) -> HorizonSolution | None:
        """Return the best plan, or None when there is none.

        After a failure the factorisation and the active set are dropped.

        Args:
            state: ξ̂ − ξ_ss, shape (n,).
            last: χ₋₁ − χ_ss, shape (m,).
            offset: v₀, shape (N m,).
            lower, upper: bounds on r and then on the further rows, shape (r + c,).
            target_pv: outputs at the target, shape (p,), about which soft bounds are written.
            path: as in :meth:`HorizonCost.linear`.
            shared: products that the caller has already; None computes them.
        """
        self.limit_reached = False
        gradient = self.cost.linear(state, last, path) if shared is None else shared.gradient
        linear = np.zeros(self.size + self._slacks)
        base = 0.0
        if shared is not None or offset.any():
            curved = self.cost.hessian @ offset if shared is None else shared.curved
            base = float(offset @ (0.5 * curved + gradient))
            gradient = gradient + curved
        linear[: self.size] = self.shape.T @ gradient
        if (lower > upper).any():
            return None
        self._fill_bounds(state, offset, lower, upper, target_pv)
        if self.size == 0:
            return self._only_plan(state, offset, base, target_pv)
        flag = self._load(linear)
        if flag < 0:
            self._ready = False
            return None
        solution, value, flag, _ = self._model.solve()
        if flag < 1 or not np.isfinite(value):
            self._ready, self.limit_reached = False, flag == OUT_OF_ITERATIONS
            return None
        variables = solution[: self.size]
        slack = np.zeros(len(target_pv))
        slack[self._bounded] = solution[self.size :]
        plan = (self.shape @ variables + offset).reshape(self.cost.horizon, -1)
        return HorizonSolution(plan, float(value) + base, slack, variables)

    def problem(
        self,
        state: FloatArray,
        last: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        target_pv: FloatArray,
        path: FloatArray | None = None,
    ) -> QpData:
        """Return the problem that :meth:`solve` would solve, without an offset."""
        linear = np.zeros(self.size + self._slacks)
        linear[: self.size] = self.shape.T @ self.cost.linear(state, last, path)
        self._fill_bounds(state, np.zeros(len(self.shape)), lower, upper, target_pv)
        return QpData(self._hessian, linear, self._matrix, self._lower, self._upper)

    def _only_plan(
        self, state: FloatArray, offset: FloatArray, cost: float, target_pv: FloatArray
    ) -> HorizonSolution:
        """Return the plan of a pattern that leaves nothing to decide."""
        plan = offset.reshape(self.cost.horizon, -1)
        slack = self.slack(state, plan, target_pv)
        return HorizonSolution(plan, cost + self.slack_cost(slack), slack, np.zeros(0))

    def slack(self, state: FloatArray, plan: FloatArray, target_pv: FloatArray) -> FloatArray:
        """Return by how much ``plan`` (N, m) breaks the soft bounds, shape (p,)."""
        pv = (self.cost.outputs(state, plan) + target_pv)[:, self._bounded]
        beyond = np.maximum(pv - self._output_bounds[:, 1], self._output_bounds[:, 0] - pv)
        slack = np.zeros(len(target_pv))
        slack[self._bounded] = np.maximum(beyond, 0.0).max(axis=0, initial=0.0)
        return slack

    def slack_cost(self, slack: FloatArray) -> float:
        """Return what ``slack`` (p,) adds to the cost."""
        return 0.5 * float(self._slack_weight @ slack[self._bounded] ** 2)

    def _fill_bounds(
        self,
        state: FloatArray,
        offset: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        target_pv: FloatArray,
    ) -> None:
        r, s = self.size, self._slacks
        rows = len(lower) - r
        self._lower[:r], self._upper[:r] = lower[:r], upper[:r]
        self._lower[r + s : r + s + rows] = lower[r:]
        self._upper[r + s : r + s + rows] = upper[r:]
        if s:
            free = (self.cost.outputs(state, offset) + target_pv)[:, self._bounded]
            first = r + s + rows
            count = free.size
            high = np.minimum(self._output_bounds[:, 1] - free, 1e30)
            low = np.maximum(self._output_bounds[:, 0] - free, -1e30)
            self._upper[first : first + count] = high.reshape(-1)
            self._lower[first + count : first + 2 * count] = low.reshape(-1)

    def _load(self, linear: FloatArray) -> int:
        if self._ready:
            return int(self._model.update(f=linear, bupper=self._upper, blower=self._lower))
        self._model = daqp.Model()
        sense = np.zeros(len(self._upper), dtype=np.int32)
        flag, _ = self._model.setup(
            self._hessian, linear, self._matrix, self._upper, self._lower, sense
        )
        self._model.settings = {"iter_limit": self._iterations}
        self._ready = flag >= 0
        return int(flag)
