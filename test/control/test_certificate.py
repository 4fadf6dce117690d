import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loops import INF, first_order, limits_for, stable_model, target_at, weights_for

from stiction_ros.control.embedding import EmbeddingMpc, EmbeddingTuning
from stiction_ros.control.pattern_problem import JumpPattern, PatternProblem
from stiction_ros.control.result import Plan
from stiction_ros.control.target import Target
from stiction_ros.effects import HeStiction

FRICTION = HeStiction(8.0, 1.0)
TUNING = EmbeddingTuning(jump_price=0.05, jump_margin=0.3)


def planned(
    mpc: EmbeddingMpc, state: np.ndarray, target: Target, last: np.ndarray
) -> tuple[Plan, float]:
    plan = mpc.plan(state, target, last)
    assert plan is not None
    return plan, plan.cost


def situation(seed: int, valves: int) -> tuple[EmbeddingMpc, np.ndarray, Target, np.ndarray]:
    model = stable_model(seed, 3, valves, 2)
    random = np.random.default_rng(seed)
    known = tuple(FRICTION if j == 0 else None for j in range(valves))
    limits = limits_for(model, move=20.0 if seed % 2 else INF)
    mpc = EmbeddingMpc(model, weights_for(model, 10), limits, known, TUNING)
    target = target_at(model, random.uniform(30.0, 70.0, valves))
    state = target.state + 3.0 * random.normal(size=3)
    return mpc, state, target, random.uniform(30.0, 70.0, valves)


@given(st.integers(0, 10_000), st.integers(1, 2))
@settings(max_examples=10)
def test_no_plan_is_cheaper_than_the_optimum(seed: int, valves: int) -> None:
    mpc, state, target, last = situation(seed, valves)
    plan, cost = planned(mpc, state, target, last)
    # Every enumerated pattern of a horizon of ten jumps within its first ten samples.
    optimum = mpc.optimum(state, target, last, 10)
    assert optimum is not None
    assert optimum <= cost * (1.0 + 1e-6) + 1e-6
    gap = mpc.optimality_gap(state, target, last, plan, 10)
    assert gap == pytest.approx((cost - optimum) / optimum, abs=1e-5)


@pytest.mark.trial
@given(st.integers(0, 10_000))
@settings(max_examples=6)
def test_the_optimum_is_that_of_all_patterns_one_by_one(seed: int) -> None:
    """Three free samples, one valve: 27 sequences of staying, up and down, each a plain QP."""
    mpc, state, target, last = situation(seed, 1)
    optimum = mpc.optimum(state, target, last, 3)
    valves, horizon = mpc.valves(last), 10
    jump = valves.least[0], min(valves.largest[0], 200.0)
    low, high = mpc.limits.stem[0]
    best = np.inf
    for signs in itertools.product((-1, 0, 1), repeat=3):
        value = _literal(mpc, state, target, float(last[0]), signs, (*jump, low, high), horizon)
        best = min(best, value + TUNING.jump_price * sum(s != 0 for s in signs))
    assert optimum == pytest.approx(best, rel=1e-4, abs=1e-4)


def _literal(
    mpc: EmbeddingMpc,
    state: np.ndarray,
    target: Target,
    last: float,
    signs: tuple[int, ...],
    bounds: tuple[float, float, float, float],
    horizon: int,
) -> float:
    """The cheapest cost with jumps of these signs, by a general minimiser over their sizes."""
    from scipy.optimize import LinearConstraint, minimize

    least, largest, low, high = bounds
    jumps = [i for i, s in enumerate(signs) if s]

    def stems(sizes: np.ndarray) -> np.ndarray:
        moves = np.zeros(horizon)
        for size, i in zip(sizes, jumps, strict=True):
            moves[i] = signs[i] * size
        return last + np.cumsum(moves)

    def cost(sizes: np.ndarray) -> float:
        v = stems(sizes) - target.stem[0]
        z, before = state - target.state, np.array([last]) - target.stem
        linear = mpc.cost.linear(z, before)
        return float(v @ (0.5 * mpc.cost.hessian @ v + linear)) + mpc.cost.constant(z, before)

    if not jumps:
        return cost(np.zeros(0))
    # After an upward jump OP = stem + f_D must fit, after a downward one stem − f_D.
    matrix = np.array([[signs[i] * (i <= at) for i in jumps] for at in jumps], dtype=float)
    lower = [low + (1.0 if signs[at] < 0 else 0.0) - last for at in jumps]
    upper = [high - (1.0 if signs[at] > 0 else 0.0) - last for at in jumps]
    best = np.inf
    for start in (least, 1.5 * least):
        found = minimize(
            cost,
            np.full(len(jumps), start),
            method="SLSQP",
            bounds=[(least, largest)] * len(jumps),
            constraints=[LinearConstraint(matrix, lower, upper)],
            options={"maxiter": 300, "ftol": 1e-13},
        )
        inside = matrix @ found.x
        if found.success and np.all(inside >= np.array(lower) - 1e-6):
            best = min(best, float(found.fun))
    return best


def test_a_plan_that_is_worse_has_a_larger_gap() -> None:
    model = first_order()
    target = target_at(model, np.array([53.0]))
    last = np.array([50.0])
    gaps = []
    for price in (0.0, 1e3):  # the second buys no jumps
        cheap = EmbeddingMpc(
            model, weights_for(model, 20), limits_for(model), (FRICTION,), EmbeddingTuning(0.0)
        )
        tuning = EmbeddingTuning(price)
        mpc = EmbeddingMpc(model, weights_for(model, 20), limits_for(model), (FRICTION,), tuning)
        plan, _ = planned(mpc, np.zeros(1), target, last)
        gaps.append(cheap.optimality_gap(np.zeros(1), target, last, plan, 8))
    assert gaps[0] < 0.05 < gaps[1]


def test_a_valve_without_limits_is_not_certified() -> None:
    model = first_order()
    limits = limits_for(model, low=-INF, high=INF)
    mpc = EmbeddingMpc(model, weights_for(model, 8), limits, (FRICTION,), TUNING)
    target = target_at(model, np.array([53.0]))
    plan, _ = planned(mpc, np.zeros(1), target, np.array([50.0]))
    assert mpc.optimality_gap(np.zeros(1), target, np.array([50.0]), plan, 5) is None


def test_on_the_tank_the_enumeration_is_near_the_optimum() -> None:
    """Mean gap over 30 set-point moves of a valve with the tank's dynamics, 10 free samples."""
    model = first_order(0.025, 0.905)
    random, gaps = np.random.default_rng(5), []
    mpc = EmbeddingMpc(model, weights_for(model, 50), limits_for(model), (FRICTION,), TUNING)
    for _ in range(30):
        goal, last = random.uniform(30.0, 70.0), random.uniform(30.0, 70.0, 1)
        target = target_at(model, np.array([goal]))
        state = target.state + random.normal(size=1) * 0.2
        plan, _ = planned(mpc, state, target, last)
        gaps.append(mpc.optimality_gap(state, target, last, plan, 10))
    assert np.mean(gaps) < 0.05


def test_the_patterns_of_the_problem_are_those_of_the_certificate() -> None:
    """One pattern's plan, certified with a single free sample, is the optimum itself."""
    mpc, state, target, last = situation(4, 1)
    costs = []
    for direction in (-1, 0, 1):
        problem = PatternProblem(mpc.cost, mpc.limits, (JumpPattern(direction),))
        solution = problem.solve(state, target, mpc.valves(last))
        if solution is not None:
            costs.append(solution.cost + TUNING.jump_price * problem.jumps)
    optimum = mpc.optimum(state, target, last, 1)
    fixed = mpc.cost.constant(state - target.state, last - target.stem)
    assert optimum == pytest.approx(min(costs) + fixed, rel=1e-6, abs=1e-6)
