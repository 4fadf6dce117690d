import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loops import first_order, limits_for, stable_model, target_at, weights_for

from stiction_ros.control.inversion import InversionMpc
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects import HeStiction


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
