"""An OP moves no further in a sample than op_rate_limits says, whatever plans it."""

import dataclasses
import math
import re

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode, MpcController
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects import Behaviour, HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, Plant

SISO = LoopModel.load(find_config("example1_process.loop.yaml"))
TANK = LoopModel.load(find_config("tank_linear.loop.yaml"))
SETTINGS = ControlSettings(horizon=30, measurement_noise=(1e-4,), state_noise=0.01)
KNOWN = HeStiction(5.0, 2.0)
NEEDED = 5.0 + 0.3 * 5.0  # f_S and the margin


def run(
    controller: MpcController,
    model: LoopModel,
    frictions: dict[str, list[Behaviour]],
    samples: int = 60,
) -> tuple[FloatArray, FloatArray]:
    """Return OP, with the first one in force, and stems of a loop after a move of the set-point."""
    plant = Plant(model.with_valve_effects(frictions), 3)
    controller.start(model.stem_start, model.pv_start)
    op, stems = [np.array(model.stem_start)], []
    sp = model.pv0 + np.array([3.0] + [0.0] * (len(model.outputs) - 1))
    for k in range(samples):
        measured = plant.measure()
        wanted = sp if k < samples // 2 else model.pv0
        result = controller.step(measured.pv, wanted, measured.dv, op[-1])
        stems.append(plant.apply(result.op).copy())
        op.append(result.op)
    return np.array(op), np.array(stems)


def controller_of(
    mode: ControlMode, limits: tuple[float, ...], model: LoopModel = SISO, **changes: object
) -> MpcController:
    settings = dataclasses.replace(SETTINGS, op_rate_limits=limits, **changes)  # type: ignore[arg-type]
    frictions = [KNOWN, *[None] * (len(model.valves) - 1)]
    return MpcController(settings.design(model), mode, frictions)


@pytest.mark.parametrize("mode", [ControlMode.EMBEDDING, ControlMode.INVERSION])
@pytest.mark.parametrize("limit", [NEEDED, 8.0, 12.0])
def test_no_step_of_op_exceeds_the_limit_and_the_valve_moves(
    mode: ControlMode, limit: float
) -> None:
    op, stems = run(controller_of(mode, (limit,)), SISO, {"V1": [KNOWN]})
    assert np.abs(np.diff(op, axis=0)).max() <= limit + 1e-9
    assert np.count_nonzero(np.diff(stems[:, 0])) >= 2


def test_a_move_that_is_cut_is_told() -> None:
    controller = controller_of(ControlMode.EMBEDDING, (NEEDED,))
    controller.start(SISO.stem_start, SISO.pv_start)
    first = controller.step(SISO.pv0, SISO.pv0 + 3.0, np.zeros(0), SISO.op0)
    assert first.plan is not None
    assert first.plan.op[0] > first.op[0] == SISO.op0[0] + NEEDED
    assert "the move of V1 is cut to its rate limit" in first.reason


def test_the_smaller_of_kick_and_rate_limit_bounds_a_jump() -> None:
    largest = {}
    for kick, rate in ((25.0, math.inf), (25.0, 9.0), (9.0, math.inf), (9.0, 25.0)):
        controller = controller_of(ControlMode.EMBEDDING, (rate,), kick_limits=(kick,))
        op, _ = run(controller, SISO, {"V1": [KNOWN]})
        largest[kick, rate] = op
    assert np.abs(np.diff(largest[25.0, math.inf], axis=0)).max() > 9.0
    # From a stem that may be anywhere a kick may go further than kick_limits, never than the rate.
    assert np.abs(np.diff(largest[9.0, math.inf], axis=0)).max() > 9.0
    assert np.abs(np.diff(largest[9.0, math.inf][1:], axis=0)).max() <= 9.0 + 1e-9
    assert np.abs(np.diff(largest[25.0, 9.0], axis=0)).max() <= 9.0 + 1e-9
    np.testing.assert_array_equal(largest[9.0, math.inf], largest[9.0, 25.0])


def test_the_healthy_valve_beside_a_sticky_one_keeps_its_own_limit() -> None:
    controller = controller_of(ControlMode.EMBEDDING, (9.0, 0.7), TANK)
    op, _ = run(controller, TANK, {"V1": [KNOWN]})
    steps = np.abs(np.diff(op, axis=0)).max(axis=0)
    assert steps[0] <= 9.0 + 1e-9
    assert 0.5 < steps[1] <= 0.7 + 1e-9


@pytest.mark.parametrize(
    ("mode", "needed"), [(ControlMode.EMBEDDING, NEEDED), (ControlMode.INVERSION, 5.0)]
)
def test_a_limit_below_the_smallest_kick_is_refused_with_what_would_do(
    mode: ControlMode, needed: float
) -> None:
    with pytest.raises(InputError) as caught:
        controller_of(mode, (0.5,))
    said = str(caught.value)
    assert caught.value.where == "op_rate_limits"
    assert f"0.5 % per sample is less than the kick that moves V1, {needed:g} %" in said
    found = re.search(r"at least ([\d.]+), or leave the controller unaware", said)
    assert found is not None
    assert float(found[1]) == pytest.approx(needed, abs=0.02)
    controller_of(mode, (float(found[1]),))
    controller_of(ControlMode.UNAWARE, (0.5,))


def test_the_printed_formulations_refuse_a_limit() -> None:
    for mode in (ControlMode.EMBEDDING, ControlMode.INVERSION):
        with pytest.raises(InputError, match="knows no rate limits") as caught:
            controller_of(mode, (20.0,), formulation="printed")
        assert caught.value.where == "op_rate_limits"


def test_a_valve_that_sticks_more_than_was_known_is_moved_in_several_samples() -> None:
    controller = controller_of(ControlMode.EMBEDDING, (NEEDED,), disturbance_noise=(1e-4,))
    op, stems = run(controller, SISO, {"V1": [HeStiction(9.0, 2.0)]}, 160)
    raised = controller.frictions[0]
    assert isinstance(raised, HeStiction)
    assert raised.static_friction > NEEDED
    assert np.abs(np.diff(op, axis=0)).max() <= NEEDED + 1e-9
    assert np.count_nonzero(np.diff(stems[:, 0])) >= 1
