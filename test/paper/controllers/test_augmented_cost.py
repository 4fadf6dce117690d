import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loops import stable_model, target_at
from paper_cases import STICKY

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.controllers.augmented_cost import AugmentedCost, PlanProblem
from stiction_ros.paper.controllers.weights import AugmentedWeights
from stiction_ros.processes import LinearModel


def random_weights(random: np.random.Generator, horizon: int, m: int, n: int) -> AugmentedWeights:
    def square(size: int) -> FloatArray:
        root = random.normal(size=(size, size))
        return root @ root.T

    first = horizon, square(n), square(m), square(n)
    return AugmentedWeights(*first, stem=square(m), op=square(m))


def equation_22(
    model: LinearModel, weights: AugmentedWeights, at: PlanProblem, op: FloatArray
) -> float:
    """(22) summed sample by sample along the simulated loop; the first valve sticks."""
    state, stem, cost = at.state, at.stem, 0.0
    for u in op:
        new = u.copy()
        new[0] = STICKY.step(float(stem[0]), float(u[0]))[1]
        x, c = state - at.target.state, stem - at.target.stem
        move, away = new - stem, u - at.target.stem
        cost += c @ weights.stem @ c + x @ weights.state @ x
        cost += move @ weights.move @ move + away @ weights.op @ away
        state = model.a @ state + model.b @ (new - model.stem0) + model.constant
        stem = new
    x = state - at.target.state
    return float(cost + x @ weights.terminal @ x)


@given(seed=st.integers(0, 2**32 - 1), horizon=st.integers(2, 12), m=st.integers(1, 3))
def test_cost_is_22_summed_along_the_hard_model(seed: int, horizon: int, m: int) -> None:
    random = np.random.default_rng(seed)
    model = stable_model(seed, 3, m, 2)
    weights = random_weights(random, horizon, m, 3)
    target = target_at(model, random.uniform(20.0, 80.0, m))
    at = PlanProblem(random.normal(size=3), random.uniform(20.0, 80.0, m), target)
    op = random.uniform(30.0, 70.0, (horizon, m))
    cost = AugmentedCost(model, weights, (STICKY, *[None] * (m - 1)))
    assert cost(at, op) == pytest.approx(equation_22(model, weights, at, op), rel=1e-8)
