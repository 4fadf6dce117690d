"""The steady-state target: where outputs and stems should come to rest."""

import dataclasses

import daqp
import numpy as np
from scipy.linalg import null_space

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel
from stiction_ros.signals.holds import set_point_moves

# With more valves than outputs the curvature is as good as singular: proximal steps then
# find the same optimum where one plain solve gives up.
PROXIMAL = 1e-5


@dataclasses.dataclass(frozen=True)
class Target:
    """A steady state of the model."""

    state: FloatArray  # ξ_ss, shape (n,)
    stem: FloatArray  # χ_ss, shape (m,), %
    pv: FloatArray  # the outputs there, shape (p,)
    reachable: bool  # whether ``pv`` meets the set-points
    miss: FloatArray  # SP − pv, shape (p,), zero when reachable
    # with a preview of the set-points, the steady states of the samples 1 … N of the horizon less
    # ``state``, shape (N, n); None when they are all the same
    path: FloatArray | None = None


class TargetSelector:
    r"""Equation (20) with the disturbance estimate: C ξ_ss + d̂ = y_sp within the stem bounds.

    All steady states are ξ_ss = ξ₀ + N_ξ r, χ_ss = χ₀ + N_χ r with N the null space of
    (I − A, −B), so the nearest one is a small bounded least-squares problem in r.
    """

    def __init__(self, model: LinearModel, weights: FloatArray, limits: FloatArray) -> None:
        """Prepare for ``weights`` (p,) on the outputs and ``limits`` (m, 2) on the stems.

        The attribute ``limits`` may be replaced, as by a valve that cannot move. A model without a
        steady state that its valves can move is refused.
        """
        self.model = model
        self.limits = limits
        n = model.order
        balance = np.hstack([np.eye(n) - model.a, -model.b])
        basis = null_space(balance, rcond=1e-10)
        self._basis_state, self._basis_stem = basis[:n], basis[n:]
        self._map = model.c @ self._basis_state
        # A trace of weight on the stems makes the choice unique where outputs leave it open.
        scale = float(np.trace(self._map.T @ (weights[:, None] * self._map)))
        if not scale > 0.0:
            raise InputError("no valve moves any output at rest", where="process model")
        self._curvature = self._map.T @ (weights[:, None] * self._map)
        self._curvature += 1e-12 * scale * np.eye(basis.shape[1])
        self._inverse = np.linalg.pinv(balance, rcond=1e-10)
        self._rest = self._inverse @ model.constant
        pull = self._map.T * weights
        self._pull, self._free = pull, np.linalg.solve(self._curvature, pull)

    def follow(self, preview: FloatArray, disturbance: FloatArray, dv: FloatArray) -> Target | None:
        """Return the target at the end of ``preview`` with the path that leads there.

        ``preview`` are the set-points now and at the samples 1 … N, shape (N + 1, p).
        ``reachable`` and ``miss`` are those of now. None when a state on the way is not
        feasible.
        """
        starts = [0, *set_point_moves(preview).tolist()]
        targets = [self.select(preview[i], disturbance, dv) for i in starts]
        found = [target for target in targets if target is not None]
        if len(found) < len(targets):
            return None
        first, last = found[0], found[-1]
        lengths = np.diff([*starts, len(preview)])
        path = np.repeat([target.state - last.state for target in found], lengths, axis=0)
        if len(found) == 1:
            return first
        return dataclasses.replace(last, reachable=first.reachable, miss=first.miss, path=path[1:])

    def select(self, sp: FloatArray, disturbance: FloatArray, dv: FloatArray) -> Target | None:
        """Return the target for set-points ``sp`` (p,), or None when no state is feasible."""
        model = self.model
        n = model.order
        origin = self._rest
        if model.e.shape[1]:
            origin = origin + self._inverse @ (model.e @ dv)
        origin_state, origin_stem = origin[:n], origin[n:]
        wanted = sp - model.pv0 - disturbance - model.c @ origin_state
        low = self.limits[:, 0] - model.stem0 - origin_stem
        high = self.limits[:, 1] - model.stem0 - origin_stem
        free = self._free @ wanted
        stem = self._basis_stem @ free
        if not np.isfinite(stem).all():
            return None
        if (stem < low).any() or (stem > high).any():
            scale = np.sqrt(np.diag(self._curvature).mean())
            free, _, flag, _ = daqp.solve(
                self._curvature / scale**2,
                -(self._pull @ wanted) / scale**2,
                np.ascontiguousarray(self._basis_stem),
                high,
                low,
                np.zeros(len(low), dtype=np.int32),
                eps_prox=PROXIMAL,
            )
            if flag < 1:
                return None
            stem = np.clip(self._basis_stem @ free, low, high)
        state = origin_state + self._basis_state @ free
        miss = wanted - self._map @ free
        reachable = bool((np.abs(miss) <= 1e-6 * (1.0 + np.abs(sp))).all())
        return Target(
            state,
            stem + origin_stem + model.stem0,
            sp - miss,
            reachable,
            np.zeros_like(miss) if reachable else miss,
        )
