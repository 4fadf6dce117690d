import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from loops import first_order, models, stable_model
from scipy.optimize import lsq_linear

from stiction_ros.control.target import TargetSelector
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

NO_DV = np.zeros(0)


def bounds(model: LinearModel, low: float = 0.0, high: float = 100.0) -> np.ndarray:
    return np.tile([low, high], (len(model.stem0), 1))


def outputs_at(model: LinearModel, stem: np.ndarray, d: np.ndarray) -> np.ndarray:
    drive = model.b @ (stem - model.stem0) + model.constant
    return model.c @ np.linalg.solve(np.eye(model.order) - model.a, drive) + model.pv0 + d


@given(models(), st.integers(0, 1000), st.floats(0.1, 10.0))
def test_a_set_point_that_some_stems_give_is_reached(
    model: LinearModel, seed: int, weight: float
) -> None:
    random = np.random.default_rng(seed)
    p, m = len(model.pv0), len(model.stem0)
    d = random.normal(size=p)
    sp = outputs_at(model, random.uniform(40.0, 60.0, m), d)
    selector = TargetSelector(model, np.full(p, weight), bounds(model))
    target = selector.select(sp, d, NO_DV)
    assert target is not None
    # Stems that differ from the wanted ones may lie outside: then the bounded search is exact.
    assert target.pv == pytest.approx(sp, abs=1e-4 * (1.0 + np.abs(sp).max()))
    assert np.all((target.stem >= 0.0) & (target.stem <= 100.0))


@given(models(), st.integers(0, 1000))
def test_a_target_is_a_steady_state_of_the_model(model: LinearModel, seed: int) -> None:
    random = np.random.default_rng(seed)
    p = len(model.pv0)
    d, sp = random.normal(size=p), 20.0 * random.normal(size=p)
    target = TargetSelector(model, np.ones(p), bounds(model)).select(sp, d, NO_DV)
    assert target is not None
    held = model.a @ target.state + model.b @ (target.stem - model.stem0) + model.constant
    scale = 1.0 + np.abs(target.state).max()
    assert target.state == pytest.approx(held, abs=1e-7 * scale)
    assert target.pv == pytest.approx(outputs_at(model, target.stem, d), abs=1e-6 * scale)
    assert target.reachable == (not target.miss.any())
    if not target.reachable:
        assert target.miss == pytest.approx(sp - target.pv, abs=1e-9 * scale)


@given(models(), st.integers(0, 1000), st.floats(50.0, 5000.0))
def test_an_unreachable_set_point_gets_the_nearest_output_within_the_bounds(
    model: LinearModel, seed: int, far: float
) -> None:
    random = np.random.default_rng(seed)
    p = len(model.pv0)
    weights, d = random.uniform(0.1, 5.0, p), random.normal(size=p)
    sp = far * random.normal(size=p)
    target = TargetSelector(model, weights, bounds(model)).select(sp, d, NO_DV)
    assert target is not None
    assert np.all((target.stem >= -1e-9) & (target.stem <= 100.0 + 1e-9))
    root = np.sqrt(weights)
    at_zero = outputs_at(model, np.zeros(len(model.stem0)), d)
    nearest = lsq_linear(root[:, None] * model.gain, root * (sp - at_zero), (0.0, 100.0), tol=1e-14)
    assume(nearest.success)
    found = float(weights @ (sp - target.pv) ** 2)
    assert found <= 2.0 * nearest.cost * (1.0 + 1e-6) + 1e-6


def test_an_unreachable_set_point_is_reported() -> None:
    model = first_order(gain=0.5)  # 20 ± 25 within 0 to 100 %
    target = TargetSelector(model, np.ones(1), bounds(model)).select(
        np.array([60.0]), np.zeros(1), NO_DV
    )
    assert target is not None
    assert not target.reachable
    assert (target.stem, target.pv, target.miss) == (
        pytest.approx([100.0]),
        pytest.approx([45.0]),
        pytest.approx([15.0]),
    )


def test_the_disturbance_estimate_enters_the_target() -> None:
    target = TargetSelector(first_order(), np.ones(1), bounds(first_order())).select(
        np.array([20.0]), np.array([5.0]), NO_DV
    )
    assert target is not None
    assert (target.stem, target.pv) == (pytest.approx([40.0]), pytest.approx([20.0]))


def test_a_measured_disturbance_enters_the_target() -> None:
    model = dataclasses.replace(first_order(gain=0.5, pole=0.9), e=np.array([[0.1]]))
    target = TargetSelector(model, np.ones(1), bounds(model)).select(
        np.array([20.0]), np.zeros(1), np.array([5.0])
    )
    assert target is not None
    assert target.stem == pytest.approx([40.0])


def test_more_valves_than_outputs_use_the_room_of_all() -> None:
    model = stable_model(4, 3, 3, 1)
    reach = np.abs(model.gain[0]).sum() * 50.0
    centre = outputs_at(model, np.full(3, 50.0), np.zeros(1))
    sp = centre + 0.95 * reach  # needs every valve near a bound
    target = TargetSelector(model, np.ones(1), bounds(model)).select(sp, np.zeros(1), NO_DV)
    assert target is not None
    assert target.reachable


@pytest.mark.parametrize("end", [0, 1])
def test_valves_without_limits_have_none(end: int) -> None:
    model = first_order()
    limits = np.array([[0.0, 100.0]])
    limits[0, end] = (-np.inf, np.inf)[end]
    sp = np.array([20.0 + (-500.0, 500.0)[end]])
    target = TargetSelector(model, np.ones(1), limits).select(sp, np.zeros(1), NO_DV)
    assert target is not None
    assert target.reachable


def test_a_process_that_no_valve_moves_is_refused() -> None:
    dead = dataclasses.replace(first_order(), b=np.zeros((1, 1)))
    with pytest.raises(InputError, match="no valve moves"):
        TargetSelector(dead, np.ones(1), bounds(dead))


def test_a_preview_ends_at_its_last_set_point_and_tells_the_way() -> None:
    model = stable_model(2, 3, 2, 2)
    selector = TargetSelector(model, np.ones(2), np.tile([-1e4, 1e4], (2, 1)))
    now, then, zero = model.pv0, model.pv0 + 1.0, np.zeros(2)
    preview = np.vstack([now, now, now, then, then])
    found = selector.follow(preview, zero, np.zeros(0))
    first, last = (selector.select(sp, zero, np.zeros(0)) for sp in (now, then))
    assert found is not None
    assert first is not None
    assert last is not None
    assert found.path is not None
    assert found.state == pytest.approx(last.state)
    expected = [first.state - last.state] * 2 + [np.zeros(3)] * 2
    assert found.path == pytest.approx(np.array(expected))


def test_a_preview_without_a_move_has_no_path() -> None:
    model = stable_model(2, 3, 2, 2)
    selector = TargetSelector(model, np.ones(2), np.tile([-1e4, 1e4], (2, 1)))
    found = selector.follow(np.tile(model.pv0, (4, 1)), np.zeros(2), np.zeros(0))
    assert found is not None
    assert found.path is None
