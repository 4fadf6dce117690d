import daqp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loops import stable_model, target_at, weights_for

from stiction_ros.control.horizon import HorizonCost
from stiction_ros.control.horizon_qp import HorizonQp

HORIZON = 8


@given(st.integers(0, 1000), st.floats(-1.0, 4.0))
def test_bounds_left_out_at_first_change_no_optimum(seed: int, room: float) -> None:
    """Whether a bound binds or not, the plan is that of the whole problem, solved at once."""
    random = np.random.default_rng(seed)
    model = stable_model(seed, 3, 2, 2)
    cost = HorizonCost(model, weights_for(model, HORIZON))
    target = target_at(model, random.uniform(40.0, 60.0, 2))
    state, last = random.normal(size=3), random.uniform(-5.0, 5.0, 2)
    bounds = np.column_stack([[-np.inf, target.pv[1] - room - 5.0], target.pv + room])
    size = HORIZON * 2
    qp = HorizonQp(cost, np.eye(size), np.zeros((0, size)), bounds)
    lower, upper = np.full(size, -30.0), np.full(size, 30.0)
    none, gradient = np.zeros(size), cost.linear(state, last)
    found = qp.solve(state, gradient, lower, upper, target.pv, none, none)
    assert found is not None
    whole, linear = qp.problem(state, last, lower, upper, target.pv)
    sense = np.zeros(len(whole.upper), dtype=np.int32)
    solution, value, flag, _ = daqp.solve(
        whole.hessian, linear, whole.matrix, whole.upper, whole.lower, sense
    )
    assert flag == 1
    assert found.cost == pytest.approx(value, rel=1e-6, abs=1e-6)
    assert found.plan.reshape(-1) == pytest.approx(solution[:size], abs=1e-3)
    assert found.slack == pytest.approx(solution[size:], abs=1e-4)


def test_a_broken_bound_is_priced_and_a_kept_one_is_not() -> None:
    model = stable_model(2, 3, 2, 2)
    cost = HorizonCost(model, weights_for(model, HORIZON))
    target = target_at(model, np.array([50.0, 50.0]))
    size = HORIZON * 2
    far = np.full(size, 30.0)

    def solved(high: float) -> tuple[float, float]:
        bounds = np.array([[-np.inf, target.pv[0] + high], [-np.inf, np.inf]])
        qp = HorizonQp(cost, np.eye(size), np.zeros((0, size)), bounds)
        gradient = cost.linear(np.ones(3), np.zeros(2))
        found = qp.solve(np.ones(3), gradient, -far, far, target.pv, 0.0 * far, 0.0 * far)
        assert found is not None
        return found.cost, found.slack[0]

    (free, none), (kept, slack), (broken, beyond) = solved(np.inf), solved(1e3), solved(-1e3)
    assert (none, slack, kept) == (0.0, 0.0, free)
    assert beyond > 900.0
    assert broken > free
