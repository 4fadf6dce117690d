import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loops import (
    INF,
    equation_19a,
    first_order,
    limits_for,
    models,
    outputs_of,
    stable_model,
    target_at,
    weights_for,
)

from stiction_ros.control.horizon import HorizonLimits, HorizonWeights
from stiction_ros.control.target import Target
from stiction_ros.control.unaware import InversionMpc, UnawareMpc
from stiction_ros.effects import HeStiction
from stiction_ros.processes import LinearModel


def uncondensed(
    model: LinearModel,
    weights: HorizonWeights,
    limits: HorizonLimits,
    state: np.ndarray,
    last: np.ndarray,
    target: Target,
) -> np.ndarray:
    """(19) with states and inputs as variables, solved by IPOPT: the stems, (N, m)."""
    problem = casadi.Opti()
    n, m, horizon = model.order, len(model.stem0), weights.horizon
    x, u = problem.variable(n, horizon + 1), problem.variable(m, horizon)
    cost = 0
    for i in range(horizon):
        z, move = x[:, i] - target.state, u[:, i] - (last if i == 0 else u[:, i - 1])
        cost += casadi.bilin(weights.state, z, z) + casadi.bilin(weights.move, move, move)
        problem.subject_to(
            x[:, i + 1] == model.a @ x[:, i] + model.b @ (u[:, i] - model.stem0) + model.constant
        )
        for j in range(m):
            problem.subject_to(problem.bounded(limits.stem[j, 0], u[j, i], limits.stem[j, 1]))
            if np.isfinite(limits.move[j]):
                problem.subject_to(problem.bounded(-limits.move[j], move[j], limits.move[j]))
    z = x[:, horizon] - target.state
    problem.minimize(cost + casadi.bilin(weights.terminal, z, z))
    problem.subject_to(x[:, 0] == state)
    problem.set_initial(u, np.tile(last[:, None], (1, horizon)))
    quiet = {"print_level": 0, "sb": "yes", "tol": 1e-12, "mu_min": 1e-15}
    problem.solver("ipopt", {"print_time": False}, quiet)
    return np.asarray(problem.solve().value(u)).reshape(m, horizon).T


@given(models(valves=2), st.integers(0, 1000), st.sampled_from([INF, 3.0]))
@settings(max_examples=8)
def test_the_plan_is_the_optimum_of_the_problem_as_printed(
    model: LinearModel, seed: int, move: float
) -> None:
    random = np.random.default_rng(seed)
    weights, limits = weights_for(model, 5, seed=seed), limits_for(model, move=move)
    m = len(model.stem0)
    target = target_at(model, random.uniform(0.0, 100.0, m))
    state = target.state + 5.0 * random.normal(size=model.order)
    last = random.uniform(0.0, 100.0, m)
    plan = UnawareMpc(model, weights, limits).plan(state, target, last)
    assert plan is not None
    literal = uncondensed(model, weights, limits, state, last, target)
    mine = equation_19a(model, weights, state, last, target, plan.stem)
    best = equation_19a(model, weights, state, last, target, literal)
    assert mine == pytest.approx(best, rel=1e-6, abs=1e-6)
    assert plan.stem == pytest.approx(literal, abs=2e-3)


@given(models(), st.integers(0, 1000), st.sampled_from([INF, 0.5, 5.0]), st.floats(1.0, 1e4))
def test_box_and_move_bounds_hold_over_the_whole_plan(
    model: LinearModel, seed: int, move: float, far: float
) -> None:
    random = np.random.default_rng(seed)
    m = len(model.stem0)
    limits = limits_for(model, 20.0, 80.0, move)
    mpc = UnawareMpc(model, weights_for(model, 8), limits)
    last = random.uniform(20.0, 80.0, m)
    for _ in range(3):  # the solver is warm after the first
        target = target_at(model, random.uniform(20.0, 80.0, m))
        plan = mpc.plan(far * random.normal(size=model.order), target, last)
        assert plan is not None
        assert np.all((plan.stem >= 20.0 - 1e-6) & (plan.stem <= 80.0 + 1e-6))
        assert np.all((plan.op >= 20.0) & (plan.op <= 80.0))
        steps = np.diff(np.vstack([last, plan.stem]), axis=0)
        assert np.abs(steps).max() <= move + 1e-6
        last = plan.op


def test_the_plan_predicts_the_outputs() -> None:
    model = stable_model(3, 3, 2, 2)
    d = np.array([0.5, -0.2])
    target = target_at(model, np.array([45.0, 60.0]), d)
    state = target.state + 1.0
    plan = UnawareMpc(model, weights_for(model), limits_for(model)).plan(
        state, target, np.array([50.0, 50.0])
    )
    assert plan is not None
    assert plan.pv == pytest.approx(outputs_of(model, state, plan.stem, d), abs=1e-9)


def test_at_the_target_nothing_moves() -> None:
    model = stable_model(5, 3, 2, 2)
    target = target_at(model, np.array([45.0, 60.0]))
    plan = UnawareMpc(model, weights_for(model), limits_for(model)).plan(
        target.state, target, target.stem
    )
    assert plan is not None
    assert plan.op == pytest.approx(target.stem, abs=1e-9)


def soft(output: tuple[float, float], goal: float) -> tuple[UnawareMpc, Target]:
    model = first_order()
    mpc = UnawareMpc(model, weights_for(model, 30, 0.01), limits_for(model, output=output))
    return mpc, target_at(model, np.array([goal]))


def test_an_output_bound_that_can_be_kept_is_kept_without_slack() -> None:
    mpc, target = soft((-INF, 27.0), 70.0)  # the target lies at 30
    plan = mpc.plan(np.zeros(1), target, np.array([50.0]))
    assert plan is not None
    assert plan.pv.max() <= 27.0 + 1e-3
    assert plan.slack == pytest.approx([0.0], abs=1e-3)


def test_an_output_bound_that_cannot_be_kept_reports_its_slack() -> None:
    mpc, target = soft((-INF, 27.0), 54.0)
    plan = mpc.plan(np.array([20.0]), target, np.array([50.0]))  # it is at 40 now
    assert plan is not None
    assert plan.slack == pytest.approx([plan.pv[1:].max() - 27.0], abs=1e-3)
    assert plan.slack[0] > 1.0


def test_the_slack_goes_when_the_bound_can_be_kept_again() -> None:
    mpc, target = soft((-INF, 27.0), 54.0)
    assert mpc.plan(np.array([20.0]), target, np.array([50.0])) is not None
    plan = mpc.plan(np.zeros(1), target, np.array([50.0]))
    assert plan is not None
    assert plan.slack == pytest.approx([0.0], abs=1e-6)


def test_a_lower_bound_works_as_an_upper_one() -> None:
    mpc, target = soft((13.0, INF), 30.0)  # the target lies at 10
    plan = mpc.plan(np.zeros(1), target, np.array([50.0]))
    assert plan is not None
    assert plan.pv.min() >= 13.0 - 1e-3


@given(st.integers(0, 999), st.floats(0.5, 10.0), st.floats(0.0, 1.0), st.floats(30.0, 70.0))
def test_the_valve_goes_as_near_to_the_plan_as_it_can(
    seed: int, static: float, share: float, last: float
) -> None:
    model, friction = stable_model(seed, 2, 1, 1), HeStiction(static, static * share)
    linear = UnawareMpc(model, weights_for(model), limits_for(model, 0.0, 100.0))
    target = target_at(model, np.array([50.0]))
    plan = InversionMpc(linear, (friction,)).plan(target.state, target, np.array([last]))
    assert plan is not None
    wanted, (reached,) = plan.stem[0, 0], (friction.step(last, plan.op[0])[1],)
    stay = abs(wanted - last)
    assert abs(reached - wanted) <= min(stay, max(friction.jump - stay, 0.0)) + 1e-6


def test_healthy_valves_get_the_linear_plan() -> None:
    model = stable_model(1, 3, 2, 2)
    linear = UnawareMpc(model, weights_for(model), limits_for(model))
    target, last = target_at(model, np.array([45.0, 60.0])), np.array([50.0, 50.0])
    plain = linear.plan(target.state, target, last)
    both = InversionMpc(linear, (None, HeStiction(8.0, 1.0))).plan(target.state, target, last)
    assert plain is not None
    assert both is not None
    assert both.op[0] == plain.op[0]
    assert both.op[1] != plain.op[1]


def test_op_stays_within_the_limits() -> None:
    model = first_order()
    linear = UnawareMpc(model, weights_for(model, 9, 1e-6), limits_for(model))
    target = target_at(model, np.array([100.0]))
    plan = InversionMpc(linear, (HeStiction(8.0, 4.0),)).plan(
        target.state - 10.0, target, np.array([50.0])
    )
    assert plan is not None
    assert plan.op == pytest.approx([100.0])
