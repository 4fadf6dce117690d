"""The stiction-unaware problem (19) as a user of do-mpc writes it; the package is optional."""

from __future__ import annotations

import warnings
from types import ModuleType
from typing import Any

import numpy as np

from stiction_ros.control.horizon import HorizonWeights
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.controllers.augmented_cost import PlanProblem
from stiction_ros.processes import LinearModel

INSTALL = "pip install do-mpc"


def load() -> ModuleType | None:
    """Return the package do-mpc, or None when it is not installed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of its own optional parts
        try:
            import do_mpc
        except ModuleNotFoundError as error:
            if error.name != "do_mpc":
                raise
            return None
    found: ModuleType = do_mpc
    return found


class DoMpc:
    """do-mpc's controller for (19a) with OP bounds, in deviations from the target.

    It is set up once. Each step is given the estimate, the last OP and, as time-varying
    parameter, χ_ss.
    """

    def __init__(
        self, package: ModuleType, model: LinearModel, weights: HorizonWeights, limits: FloatArray
    ) -> None:
        """Set up; ``limits`` of OP, shape (m, 2), %."""
        import casadi

        m, n = len(model.stem0), model.order
        formula = package.model.Model("discrete", symvar_type="SX")
        state = formula.set_variable("_x", "z", shape=(n, 1))
        op = formula.set_variable("_u", "u", shape=(m, 1))
        goal = formula.set_variable("_tvp", "goal", shape=(m, 1))
        formula.set_rhs("z", model.a @ state + model.b @ (op - goal))
        formula.setup()
        mpc = package.controller.MPC(formula)
        mpc.set_param(n_horizon=weights.horizon, t_step=1.0, store_full_solution=False, n_robust=0)
        mpc.settings.supress_ipopt_output()
        stage = casadi.mtimes([state.T, weights.state, state])
        mpc.set_objective(mterm=casadi.mtimes([state.T, weights.terminal, state]), lterm=stage)
        mpc.set_rterm(u=np.diag(weights.move))
        mpc.bounds["lower", "_u", "u"] = limits[:, 0]
        mpc.bounds["upper", "_u", "u"] = limits[:, 1]
        self._template = mpc.get_tvp_template()
        mpc.set_tvp_fun(lambda _time: self._template)
        mpc.setup()
        self._mpc: Any = mpc
        self._started = False

    def __call__(self, at: PlanProblem) -> FloatArray:
        """Return the first OP, shape (m,), %."""
        mpc = self._mpc
        self._template["_tvp", :, "goal"] = at.target.stem
        state = at.state - at.target.state
        mpc.u0 = at.stem
        if not self._started:
            mpc.x0 = state
            mpc.set_initial_guess()
            self._started = True
        return np.array(mpc.make_step(state.reshape(-1, 1))).reshape(-1)
