import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loops import stable_model, target_at, weights_for

from stiction_ros.control.box_bounds import box_bounds
from stiction_ros.control.embedding import EmbeddingMpc, EmbeddingTuning
from stiction_ros.control.horizon import HorizonLimits
from stiction_ros.control.target import Target
from stiction_ros.effects import HeStiction


def problem(
    seed: int, healthy: int, sticky: int, *, bounded: bool
) -> tuple[EmbeddingMpc, np.ndarray, Target, np.ndarray]:
    """A random embedding with its state, its target and its stems."""
    random = np.random.default_rng(seed)
    m = healthy + sticky
    model = stable_model(seed, int(random.integers(1, 4)), m, int(random.integers(1, 3)))
    weights = weights_for(model, 12, float(random.choice([0.001, 0.1])), seed)
    limits = HorizonLimits(
        np.tile([0.0, 100.0] if bounded else [-1e5, 1e5], (m, 1)),
        np.full(m, 4.0 if bounded else np.inf),
        np.tile([-5.0, 5.0] if bounded else [-np.inf, np.inf], (len(model.c), 1)),
    )
    frictions = [
        HeStiction(f, 0.3 * f) if j < sticky else None
        for j, f in enumerate(random.uniform(1.0, 12.0, m))
    ]
    kicks = np.full(m, float(random.choice([5.0, 25.0, np.inf])))
    tuning = EmbeddingTuning(float(random.choice([0.0, 0.5])), kick_limits=kicks)
    mpc = EmbeddingMpc(model, weights, limits, frictions, tuning)
    target = target_at(model, random.uniform(30.0, 70.0, m))
    state = target.state + random.normal(size=model.order)
    return mpc, state, target, random.uniform(30.0, 70.0, m)


TRIALS = 1000 if os.environ.get("STICTION_ALL_TRIALS") == "1" else 15


@given(st.integers(0, 10**6), st.integers(0, 1), st.integers(1, 3), st.booleans())
@settings(max_examples=TRIALS)
def test_no_bound_is_above_its_programme_and_the_plan_is_the_cheapest(
    seed: int, healthy: int, sticky: int, bounded: bool
) -> None:
    mpc, state, target, last = problem(seed, healthy, sticky, bounded=bounded)
    valves = mpc.valves(last)
    gradient = mpc.cost.linear(state - target.state, last - target.stem)
    bounds = mpc._bounds.of(gradient, last - target.stem, valves)
    costs = np.full(len(bounds), np.inf)
    for i, programme in enumerate(mpc._problems):
        found = programme.solve(state, target, valves)
        if found is not None:
            assert bounds[i] <= found.cost + 1e-7 * (1.0 + abs(found.cost))
            costs[i] = found.cost + mpc.tuning.jump_price * programme.jumps
    plan = mpc.plan(state, target, last)
    assert plan is not None
    constant = mpc.cost.constant(state - target.state, last - target.stem)
    scale = 1.0 + abs(constant) + abs(costs.min())
    assert plan.cost == pytest.approx(costs.min() + constant, abs=1e-8 * scale)


def test_without_limits_the_bound_is_the_optimum_and_few_programmes_are_solved() -> None:
    solved = []
    for seed in range(20):
        mpc, state, target, last = problem(seed, 0, 2, bounded=False)
        valves = mpc.valves(last)
        gradient = mpc.cost.linear(state - target.state, last - target.stem)
        bounds = mpc._bounds.of(gradient, last - target.stem, valves)
        for bound, programme in zip(bounds, mpc._problems, strict=True):
            found = programme.solve(state, target, valves)
            assert found is not None
            assert bound == pytest.approx(found.cost, rel=1e-6, abs=1e-6)
        assert mpc.plan(state, target, last) is not None
        solved.append(mpc.solved)
    assert np.median(solved) <= 0.1 * 81


@given(st.integers(0, 10**6), st.integers(1, 6))
def test_the_bound_of_a_box_is_below_every_point_and_reached(seed: int, size: int) -> None:
    random = np.random.default_rng(seed)
    root = random.normal(size=(size + 1, size))
    hessian, linear = root.T @ root + 1e-3 * np.eye(size), 5.0 * random.normal(size=size)
    low = random.uniform(0.0, 1.0, (1, size))
    high = low + random.uniform(0.0, 2.0, (1, size))
    signs = random.choice([-1.0, 1.0], (1, size))
    jumps = (np.arange(size, dtype=np.int64)[None], signs, np.array([size], dtype=np.int64))
    (bound,) = box_bounds(hessian, linear, jumps, (low, high))

    def value(sizes: np.ndarray) -> float:
        moves = signs[0] * sizes
        return float(0.5 * moves @ hessian @ moves + linear @ moves)

    best = 0.5 * (low[0] + high[0])
    step = 1.0 / np.linalg.eigvalsh(hessian)[-1]
    for _ in range(20_000):
        slope = signs[0] * (hessian @ (signs[0] * best) + linear)
        after = np.clip(best - step * slope, low[0], high[0])
        if np.array_equal(after, best):
            break
        best = after
    assert bound <= value(best) + 1e-9 * (1.0 + abs(value(best)))
    assert bound == pytest.approx(value(best), rel=1e-4, abs=1e-4)


def test_the_first_jump_reaches_from_wherever_the_stem_may_be() -> None:
    mpc, _, _, last = problem(3, 1, 1, bounded=False)
    mpc.know(mpc.forms, None, np.column_stack([last - 2.0, last + 3.0]))
    valves = mpc.valves(last)
    least, largest = valves.jump_sizes
    assert least[0] == pytest.approx(valves.least[0] + np.array([3.0, 2.0, 0.0]))
    assert (largest >= least).all()
