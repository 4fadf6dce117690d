import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loops import equation_19a, models, outputs_of, stable_model, target_at, weights_for

from stiction_ros.control.horizon import HorizonCost
from stiction_ros.processes import LinearModel


@given(models(), st.integers(1, 8), st.integers(0, 1000))
def test_the_condensed_cost_is_19a(model: LinearModel, horizon: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    weights = weights_for(model, horizon, seed=seed)
    m = len(model.stem0)
    target = target_at(model, random.uniform(20.0, 80.0, m))
    state = target.state + random.normal(size=model.order)
    last = random.uniform(0.0, 100.0, m)
    stems = random.uniform(0.0, 100.0, (horizon, m))
    cost, z, v0 = HorizonCost(model, weights), state - target.state, last - target.stem
    v = (stems - target.stem).reshape(-1)
    condensed = 0.5 * v @ cost.hessian @ v + v @ cost.linear(z, v0) + cost.constant(z, v0)
    literal = equation_19a(model, weights, state, last, target, stems)
    assert condensed == pytest.approx(literal, rel=1e-9, abs=1e-6)


@given(models(), st.integers(1, 8), st.integers(0, 1000))
def test_condensed_outputs_are_simulated_ones(model: LinearModel, horizon: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    m, p = len(model.stem0), len(model.pv0)
    target = target_at(model, random.uniform(20.0, 80.0, m))
    state = target.state + random.normal(size=model.order)
    stems = random.uniform(0.0, 100.0, (horizon, m))
    cost = HorizonCost(model, weights_for(model, horizon))
    condensed = cost.outputs(state - target.state, stems - target.stem) + target.pv
    literal = outputs_of(model, state, stems, np.zeros(p))[1:]
    assert condensed == pytest.approx(literal, abs=1e-6)


def test_the_hessian_is_symmetric_and_positive() -> None:
    from loops import stable_model

    hessian = HorizonCost(model := stable_model(2, 4, 2, 2), weights_for(model, 20)).hessian
    assert np.array_equal(hessian, hessian.T)
    assert np.linalg.eigvalsh(hessian).min() > 0.0


def test_a_path_of_steady_states_is_what_19a_is_measured_from() -> None:
    model = stable_model(8, 3, 2, 2)
    weights = weights_for(model, 7)
    cost = HorizonCost(model, weights)
    random = np.random.default_rng(1)
    state, last = random.normal(size=3), random.normal(size=2)
    path, moved = random.normal(size=(9, 3)), random.normal(size=(7, 2))
    v = moved.reshape(-1)
    found = v @ (0.5 * cost.hessian @ v + cost.linear(state, last, path))
    found += cost.constant(state, last, path)
    z, before, literal = state, last, 0.0
    for i, stem in enumerate(moved):
        off = z - path[max(i - 1, 0)]
        literal += off @ weights.state @ off
        literal += (stem - before) @ weights.move @ (stem - before)
        z, before = model.a @ z + model.b @ stem, stem
    off = z - path[6]
    literal += off @ weights.terminal @ off
    assert found == pytest.approx(literal, rel=1e-9)


@given(models(), st.integers(1, 6), st.integers(0, 9), st.integers(0, 1000))
def test_what_a_plan_leaves_counts_for_as_long_as_is_looked_ahead(
    model: LinearModel, horizon: int, ahead: int, seed: int
) -> None:
    """A plan is as dear as one that holds its last stems under a longer horizon."""
    random = np.random.default_rng(seed)
    short = weights_for(model, horizon)
    short = dataclasses.replace(short, terminal=short.state, look_ahead=ahead)
    cost = HorizonCost(model, short)
    state, last = random.normal(size=model.order), random.normal(size=len(model.stem0))
    plan = random.normal(size=(horizon, len(last)))
    held = np.vstack([plan, np.repeat(plan[-1:], ahead, axis=0)])
    target = target_at(model, model.stem0)
    long = dataclasses.replace(short, horizon=horizon + ahead, look_ahead=0)
    literal = equation_19a(
        model, long, target.state + state, target.stem + last, target, held + target.stem
    )
    v = plan.reshape(-1)
    for path in (None, np.zeros((horizon, model.order))):
        found = 0.5 * v @ cost.hessian @ v + v @ cost.linear(state, last, path)
        assert found + cost.constant(state, last, path) == pytest.approx(literal, rel=1e-9)
