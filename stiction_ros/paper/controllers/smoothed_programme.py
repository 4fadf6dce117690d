"""The paper's stiction-embedding programme: (17)-(18) smoothed by (6), cost (22), by IPOPT."""

import dataclasses
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.controllers.augmented_cost import AugmentedCost, PlanProblem
from stiction_ros.paper.controllers.weights import PaperTuning

KEPT = ("Solve_Succeeded", "Solved_To_Acceptable_Level", "Maximum_Iterations_Exceeded")
"""IPOPT's words for an end whose answer is kept."""


@dataclasses.dataclass(frozen=True)
class ProgrammeResult:
    """What IPOPT found."""

    op: FloatArray | None  # u over the horizon, shape (N, m), %, in the limits; None when failed
    cost: float  # (22) under the smoothed model; inf when failed
    iterations: int  # number of them


class SmoothedProgramme:
    r"""The programme in u_i, χ_i of sticky valves, and ξ_i, all kept as unknowns.

    .. math::
        \chi_i = \varphi_S(\chi_{i-1}, u_i), \quad
        \xi_{i+1} - \xi_{ss} = A (\xi_i - \xi_{ss}) + B (\chi_i - \chi_{ss}), \quad
        0 \le u_i, \chi_i \le 100.

    The steady state of the target carries bias and measured disturbances, which stay as they
    are over the horizon. A law with a direction of motion brings that as an unknown more, which
    is 0 at the start: the valve rests. The programme is built once; estimate, target and friction
    are its parameters.
    """

    def __init__(self, cost: AugmentedCost, tuning: PaperTuning, limits: FloatArray) -> None:
        """Build; ``limits`` (m, 2), %."""
        from stiction_ros.paper.smoothed_laws import smooth_law  # compiled: slow to import

        self.cost, self.model, self.tuning = cost, cost.model, tuning
        self._sticky = [j for j, friction in enumerate(cost.frictions) if friction is not None]
        pairs = [friction for friction in cost.frictions if friction is not None]
        self._friction = np.array([(f.static_friction, f.dynamic_friction) for f in pairs])
        horizon, m, n = cost.horizon, len(limits), self.model.order
        self._laws = [smooth_law(str(friction.law)) for friction in pairs]
        self._directed = [row for row, law in enumerate(self._laws) if law.states > 1]
        self._shape = (horizon, m + len(self._sticky) + len(self._directed) + n)
        open_end = np.full((n, 2), [-np.inf, np.inf])
        turns = np.full((len(self._directed), 2), [-1.0, 1.0])
        sample = np.vstack([limits, limits[self._sticky], turns, open_end])
        self._lower, self._upper = np.tile(sample[:, 0], horizon), np.tile(sample[:, 1], horizon)
        self._limits = limits
        self._solver = self._build()

    def _build(self) -> Any:
        import casadi

        model, weights = self.model, self.cost.weights
        m, n, sticky = len(model.stem0), model.order, self._sticky
        start = casadi.SX.sym("z_0", n), casadi.SX.sym("chi_before", m)
        goal, before = casadi.SX.sym("chi_ss", m), casadi.SX.sym("u_before", m)
        friction = casadi.SX.sym("friction", len(sticky), 2)
        state, stem = start
        last, ways = before, [casadi.SX(0.0) for _ in sticky]
        unknowns, residuals, cost = [], [], 0.0
        for i in range(weights.horizon):
            op = casadi.SX.sym(f"u_{i}", m)
            stuck = casadi.SX.sym(f"chi_{i}", len(sticky))
            turn = casadi.SX.sym(f"d_{i}", len(self._directed))
            after = casadi.SX.sym(f"z_{i + 1}", n)
            unknowns += [op, stuck, turn, after]
            moved = casadi.SX(op)
            for row, j in enumerate(sticky):
                figures = friction[row, 0], friction[row, 1], self.tuning.smoothing
                law, memory = self._laws[row], [stem[j], ways[row]]
                follows, *way = law.step(memory, (op[j], last[j]), figures, casadi.tanh)
                residuals.append(follows - stuck[row])
                moved[j] = stuck[row]
                if row in self._directed:
                    ways[row] = turn[self._directed.index(row)]
                    residuals.append(way[0] - ways[row])
            drive = casadi.mtimes(model.b, moved - goal)
            residuals.append(casadi.mtimes(model.a, state) + drive - after)
            cost += _square(stem - goal, weights.stem) + _square(state, weights.state)
            cost += _square(moved - stem, weights.move) + _square(op - goal, weights.op)
            if weights.op_move is not None:
                cost += _square(op - last, weights.op_move)
            state, stem, last = after, moved, op
        cost += _square(state, weights.terminal)
        problem = {
            "x": casadi.vertcat(*unknowns),
            "p": casadi.vertcat(*start, goal, before, casadi.vec(friction)),
            "f": cost,
            "g": casadi.vertcat(*residuals),
        }
        options: dict[str, Any] = {
            "ipopt.max_iter": self.tuning.iterations,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "print_time": False,
            "calc_lam_p": False,
            "error_on_fail": False,
        }
        return casadi.nlpsol("stiction_embedding", "ipopt", problem, options)

    def solve(self, situation: PlanProblem, op: FloatArray, stems: FloatArray) -> ProgrammeResult:
        """Return the optimum that IPOPT reaches from OP and stems by the hard model, (N, m), %."""
        target = situation.target
        state = situation.state - target.state
        parameters = (
            state,
            situation.stem,
            target.stem,
            situation.op_before,
            self._friction.T.reshape(-1),
        )
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
        if stats["return_status"] not in KEPT or not np.isfinite(found).all():
            return ProgrammeResult(None, float("inf"), iterations)
        inside = np.clip(found, self._limits[:, 0], self._limits[:, 1])
        return ProgrammeResult(inside, cost, iterations)

    def _guess(self, situation: PlanProblem, op: FloatArray, stems: FloatArray) -> FloatArray:
        """Return all unknowns of the start, simulated, shape (N (m + s + n),)."""
        model, target = self.model, situation.target
        state = situation.state - target.state
        states = np.empty((len(op), model.order))
        for i, drive in enumerate((stems - target.stem) @ model.b.T):
            state = model.a @ state + drive
            states[i] = state
        stuck = stems[:, self._sticky]
        moves = np.diff(np.vstack([situation.stem[self._sticky], stuck]), axis=0)
        turns = np.sign(moves[:, self._directed])
        return np.hstack([op, stuck, turns, states]).reshape(-1)


def _square(vector: Any, weight: FloatArray) -> Any:
    import casadi

    return casadi.mtimes([vector.T, weight, vector])
