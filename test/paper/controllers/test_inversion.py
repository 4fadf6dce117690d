import functools

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from loops import first_order, kalman, limits_for, target_at, weights_for

from stiction_ros.control import ControlDesign, ControlMode, MpcController
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects import HeStiction
from stiction_ros.paper.controllers.embedding import PrintedInversionMpc, as_printed
from stiction_ros.paper.controllers.weights import PaperTuning, WeightPreset, augmented_weights

MODEL = first_order()
FRICTION = HeStiction(4.0, 1.0)


def controller() -> PrintedInversionMpc:
    linear = UnawareMpc(MODEL, weights_for(MODEL, move=0.1), limits_for(MODEL))
    return PrintedInversionMpc(linear, (FRICTION,))


@given(goal=st.floats(30.0, 70.0))
def test_moves_beyond_the_smallest_jump_are_inverted_exactly(goal: float) -> None:
    start = np.array([50.0])
    plan = controller().plan(
        target_at(MODEL, start).state, target_at(MODEL, np.array([goal])), start
    )
    assert plan is not None
    wanted = float(plan.process_input[0])
    assume(abs(wanted - 50.0) > FRICTION.jump + 1e-9 and 1.0 < wanted < 99.0)
    assert abs(FRICTION.step(50.0, float(plan.op[0]))[1] - wanted) < 1e-9


def test_a_smaller_move_leaves_the_stem_where_it_is() -> None:
    start = np.array([50.0])
    plan = controller().plan(
        target_at(MODEL, start).state, target_at(MODEL, np.array([50.5])), start
    )
    assert plan is not None
    assert FRICTION.step(50.0, float(plan.op[0]))[1] == 50.0


def test_the_observer_takes_the_wanted_stem_for_the_stem() -> None:
    weights = weights_for(MODEL)
    design = ControlDesign(
        MODEL,
        limits_for(MODEL),
        weights,
        weights,
        np.ones(1),
        kalman(1),
        others=functools.partial(
            as_printed, PaperTuning(augmented_weights(WeightPreset.CORRECTED, MODEL, 6))
        ),
    )
    mpc = MpcController(design, ControlMode.INVERSION, (FRICTION,))
    mpc.start(np.array([50.0]), np.array([20.0]))
    result = mpc.step(np.array([20.0]), np.array([20.3]), np.zeros(0), np.array([50.0]))
    assert result.plan is not None
    assert mpc.stem.tolist() == result.plan.stem[0].tolist()
    assert mpc.stem[0] > 50.0
    assert FRICTION.step(50.0, float(result.op[0]))[1] == 50.0
