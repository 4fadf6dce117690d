"""The paper's stiction-embedding programme: (17)-(18) smoothed by (6), cost (22), by IPOPT."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_ros.control.augmented_cost import PlanProblem
from stiction_ros.control.paper_weights import PaperTuning
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.stiction_he_smoothed import smoothed_step
from stiction_ros.processes import LinearModel


class ProgrammeStatus(enum.StrEnum):
    """How IPOPT ended."""

    SOLVED = "solved"
    LIMIT = "limit"  # iterations used up; what was reached is kept
    FAILED = "failed"


_SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
_LIMIT = "Maximum_Iterations_Exceeded"


@dataclasses.dataclass(frozen=True)
class ProgrammeResult:
    """What IPOPT found.

    Attributes:
        status: how it ended.
        op: u over the horizon, shape (N, m), %, within the limits; None when failed.
        cost: (22) under the smoothed model; inf when failed.
        iterations: number of them.
    """

    status: ProgrammeStatus
    op: FloatArray | None
    cost: float
    iterations: int


class SmoothedProgramme:
    r"""The programme in u_i, χ_i of sticky valves, and ξ_i, all kept as unknowns.

    .. math::
        \chi_i = \varphi_S(\chi_{i-1}, u_i), \quad
        \xi_{i+1} - \xi_{ss} = A (\xi_i - \xi_{ss}) + B (\chi_i - \chi_{ss}), \quad
        0 \le u_i, \chi_i \le 100.

    The steady state of the target carries bias and measured disturbances, which stay as they
    are over the horizon. The programme is built once; estimate, target and friction are its
    parameters.
    """

    def __init__(
        self,
        model: LinearModel,
        tuning: PaperTuning,
        frictions: Sequence[HeStiction | None],
        limits: FloatArray,
    ) -> None:
        """Build.

        Args:
            model: the process.
            tuning: weights, τ and iteration limit.
            frictions: one entry per valve, None for a healthy one.
            limits: of stems and OP, shape (m, 2), %.
        """
        self.model, self.tuning = model, tuning
        self._sticky = [j for j, friction in enumerate(frictions) if friction is not None]
        pairs = [friction for friction in frictions if friction is not None]
        self._friction = np.array([(f.static_friction, f.dynamic_friction) for f in pairs])
        horizon, m, n = tuning.weights.horizon, len(model.stem0), model.order
        self._shape = (horizon, m + len(self._sticky) + n)
        open_end = np.full((n, 2), [-np.inf, np.inf])
        sample = np.vstack([limits, limits[self._sticky], open_end])
        self._lower, self._upper = np.tile(sample[:, 0], horizon), np.tile(sample[:, 1], horizon)
        self._limits = limits
        self._solver = self._build()

    def _build(self) -> Any:
        import casadi

        model, weights = self.model, self.tuning.weights
        m, n, sticky = len(model.stem0), model.order, self._sticky
        start = casadi.SX.sym("z_0", n), casadi.SX.sym("chi_before", m)
        goal = casadi.SX.sym("chi_ss", m)
        friction = casadi.SX.sym("friction", len(sticky), 2)
        state, stem = start
        unknowns, residuals, cost = [], [], 0.0
        for i in range(weights.horizon):
            op = casadi.SX.sym(f"u_{i}", m)
            stuck = casadi.SX.sym(f"chi_{i}", len(sticky))
            after = casadi.SX.sym(f"z_{i + 1}", n)
            unknowns += [op, stuck, after]
            moved = casadi.SX(op)
            for row, j in enumerate(sticky):
                pair = friction[row, 0], friction[row, 1]
                follows = smoothed_step(stem[j], op[j], pair, self.tuning.smoothing, casadi.tanh)
                residuals.append(follows - stuck[row])
                moved[j] = stuck[row]
            drive = casadi.mtimes(model.b, moved - goal)
            residuals.append(casadi.mtimes(model.a, state) + drive - after)
            cost += _square(stem - goal, weights.stem) + _square(state, weights.state)
            cost += _square(moved - stem, weights.move) + _square(op - goal, weights.op)
            state, stem = after, moved
        cost += _square(state, weights.terminal)
        problem = {
            "x": casadi.vertcat(*unknowns),
            "p": casadi.vertcat(*start, goal, casadi.vec(friction)),
            "f": cost,
            "g": casadi.vertcat(*residuals),
        }
        return casadi.nlpsol("stiction_embedding", "ipopt", problem, self._options())

    def _options(self) -> dict[str, Any]:
        return {
            "ipopt.max_iter": self.tuning.iterations,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "print_time": False,
            "calc_lam_p": False,
            "error_on_fail": False,
        }

    def solve(self, situation: PlanProblem, op: FloatArray, stems: FloatArray) -> ProgrammeResult:
        """Return the local optimum that IPOPT reaches.

        Args:
            situation: estimate and target.
            op, stems: the start, shape (N, m) each, %, stems under the hard model.
        """
        target = situation.target
        state = situation.state - target.state
        parameters = (state, situation.stem, target.stem, self._friction.T.reshape(-1))
        solution = self._solver(
            x0=self._guess(situation, op, stems),
            p=np.concatenate(parameters),
            lbx=self._lower,
            ubx=self._upper,
            lbg=0.0,
            ubg=0.0,
        )
        stats = self._solver.stats()
        found = np.array(solution["x"]).reshape(self._shape)[:, : op.shape[1]]
        cost, iterations = float(solution["f"]), int(stats["iter_count"])
        status = _status(stats["return_status"])
        if status is ProgrammeStatus.FAILED or not np.isfinite(found).all():
            return ProgrammeResult(ProgrammeStatus.FAILED, None, float("inf"), iterations)
        inside = np.clip(found, self._limits[:, 0], self._limits[:, 1])
        return ProgrammeResult(status, inside, cost, iterations)

    def _guess(self, situation: PlanProblem, op: FloatArray, stems: FloatArray) -> FloatArray:
        """Return all unknowns of the start, simulated, shape (N (m + s + n),)."""
        model, target = self.model, situation.target
        state = situation.state - target.state
        states = np.empty((len(op), model.order))
        for i, drive in enumerate((stems - target.stem) @ model.b.T):
            state = model.a @ state + drive
            states[i] = state
        return np.hstack([op, stems[:, self._sticky], states]).reshape(-1)


def _status(text: str) -> ProgrammeStatus:
    if text in _SOLVED:
        return ProgrammeStatus.SOLVED
    return ProgrammeStatus.LIMIT if text == _LIMIT else ProgrammeStatus.FAILED


def _square(vector: Any, weight: FloatArray) -> Any:
    import casadi

    return casadi.mtimes([vector.T, weight, vector])
