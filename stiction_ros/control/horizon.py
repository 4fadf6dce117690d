"""The finite-horizon problem (19), condensed to the stem moves."""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.processes import LinearModel

ITERATION_LIMIT = 2000


@dataclasses.dataclass(frozen=True)
class HorizonWeights:
    """Penalties of (19a)."""

    horizon: int  # N_H, samples
    state: FloatArray  # Q, shape (n, n)
    move: FloatArray  # S, shape (m, m), on Δχ (which is Δu for valves without friction)
    terminal: FloatArray  # V_F, shape (n, n)
    look_ahead: int = 0  # samples beyond the horizon, with stems at rest, that Q counts


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

    Behind the horizon the last stems stay for ``look_ahead`` samples more, which Q counts too: an
    offset that a plan leaves is not over with the plan.

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
        # The end of the plan as (z_N, v_{N-1}), from the plan and from z_0.
        by_plan = np.zeros((n + m, horizon * m))
        by_plan[:n], by_plan[n:, -m:] = forced[-1], np.eye(m)
        by_state = np.vstack([power, np.zeros((m, n))])
        later = _later(model, weights)
        hessian += by_plan.T @ later @ by_plan
        self.from_state += 2.0 * by_plan.T @ later @ by_state
        self._constant_later = by_state.T @ later @ by_state
        self._from_path = -2.0 * weighted  # (N, n, N m)
        difference = np.eye(horizon * m) - np.eye(horizon * m, k=-m)
        moves = np.kron(np.eye(horizon), weights.move)
        hessian = 2.0 * (hessian + difference.T @ moves @ difference)
        self.hessian = 0.5 * (hessian + hessian.T)
        self.from_last = np.zeros((horizon * m, m))
        self.from_last[:m] = -2.0 * weights.move
        self._weights, self._free, self._penalties = weights, free, penalties
        self._constant_state = weights.state + np.einsum("ija,ijk,ikb->ab", free, penalties, free)
        self._constant_state += self._constant_later
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
        now_and_later = now @ weights.state @ now + state @ self._constant_later @ state
        return float(ahead + now_and_later + moves)

    def outputs(self, state: FloatArray, plan: FloatArray) -> FloatArray:
        """Return output deviations from the target, shape (N, p), for samples 1 … N."""
        free = self.free_output.reshape(-1, len(state)) @ state  # one product, not one a sample
        free += self.forced_output.reshape(len(free), -1) @ plan.reshape(-1)
        return np.asarray(free.reshape(self.horizon, -1))


def _later(model: LinearModel, weights: HorizonWeights) -> FloatArray:
    """Return the cost behind the horizon as a quadratic in (z_N, v_{N-1}), (n + m, n + m)."""
    n, m = model.order, model.b.shape[1]
    total = np.zeros((n + m, n + m))
    reach = np.eye(n, n + m)
    for _ in range(weights.look_ahead):
        reach = model.a @ reach
        reach[:, n:] += model.b
        total += reach.T @ weights.state @ reach
    return total
