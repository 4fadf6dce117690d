import dataclasses

import numpy as np
import pytest
from loops import first_order, kalman, limits_for, stable_model, weights_for

from stiction_ros.control import ControlDesign, ControlMode, History, MpcController, StepStatus
from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

NO_DV = np.zeros(0)
FRICTION = HeStiction(8.0, 1.0)


def design_for(model: LinearModel, **options: float) -> ControlDesign:
    p = len(model.pv0)
    return ControlDesign(
        model,
        limits_for(model, **options),
        weights_for(model, 15),
        weights_for(model, 15, 0.01),
        np.ones(p),
        kalman(p),
    )


class Loop:
    """A plant of ``model`` with sticky valves under ``controller``."""

    def __init__(
        self,
        model: LinearModel,
        controller: MpcController,
        friction: HeStiction | None = None,
        disturbance: float = 0.0,
    ) -> None:
        self.model, self.controller, self.friction = model, controller, friction
        self.disturbance = disturbance
        self.x = np.zeros(model.order)
        self.stem, self.applied = np.array(model.stem0), np.array(model.stem0)
        self.op: list[np.ndarray] = []
        self.pv: list[np.ndarray] = []
        self.stems: list[np.ndarray] = []

    def run(self, samples: int, sp: np.ndarray) -> np.ndarray:
        """Advance and return the last output."""
        for _ in range(samples):
            pv = self.model.c @ self.x + self.model.pv0 + self.disturbance
            result = self.controller.step(pv, sp, NO_DV, self.applied)
            self.applied = result.op
            if self.friction is None:
                self.stem = result.op.copy()
            else:
                moved = [
                    self.friction.step(float(s), float(u))[1]
                    for s, u in zip(self.stem, result.op, strict=True)
                ]
                self.stem = np.array(moved)
            self.x = self.model.a @ self.x + self.model.b @ (self.stem - self.model.stem0)
            self.x = self.x + self.model.constant
            self.op.append(result.op)
            self.pv.append(pv)
            self.stems.append(self.stem)
        return self.model.c @ self.x + self.model.pv0 + self.disturbance

    @property
    def history(self) -> History:
        return History(np.array(self.op), np.array(self.pv), np.zeros((len(self.op), 0)))


def test_a_wrong_model_and_a_disturbance_leave_no_offset() -> None:
    controller = MpcController(design_for(first_order(gain=0.5)), ControlMode.UNAWARE)
    loop = Loop(first_order(gain=0.8, pole=0.85), controller, disturbance=-3.0)
    assert loop.run(400, np.array([24.0])) == pytest.approx([24.0], abs=1e-6)


def test_a_sticky_valve_that_is_known_lets_the_loop_come_to_rest() -> None:
    model = first_order()
    controller = MpcController(design_for(model), ControlMode.EMBEDDING, (FRICTION,))
    loop = Loop(model, controller, FRICTION)
    final = loop.run(300, np.array([24.0]))
    assert abs(final[0] - 24.0) < 0.5 * FRICTION.static_friction * 0.5
    assert np.ptp(np.array(loop.op[-50:])) == 0.0


def test_the_stem_estimate_is_the_true_stem() -> None:
    model = first_order()
    controller = MpcController(design_for(model), ControlMode.EMBEDDING, (FRICTION,))
    loop = Loop(model, controller, FRICTION)
    for sp in (24.0, 15.0, 22.0):
        loop.run(30, np.array([sp]))
        assert controller.stem == pytest.approx(loop.stem, abs=1e-9)


@pytest.mark.parametrize("mode", [ControlMode.EMBEDDING, ControlMode.INVERSION])
def test_taking_over_finds_the_true_stem_after_one_slip_from_wherever_it_was(
    mode: ControlMode,
) -> None:
    model = first_order()
    unaware = MpcController(design_for(model), ControlMode.UNAWARE)
    loop = Loop(model, unaware, FRICTION)
    loop.stem = np.array([44.0])  # the controller's 50 % is not where the stem is
    loop.run(80, np.array([26.0]))
    loop.run(80, np.array([12.0]))
    op = np.array(loop.op)[:, 0]
    reach = op.max() - op.min()
    assert reach > 2.0 * FRICTION.static_friction + 14.0, "no move slips from every start"
    successor = MpcController(design_for(model), mode, (FRICTION,))
    successor.take_over(loop.history)
    assert successor.stem == pytest.approx(loop.stem, abs=1e-12)


def test_taking_over_goes_on_without_a_step_in_the_estimate() -> None:
    model = first_order()
    first = MpcController(design_for(model), ControlMode.UNAWARE)
    loop = Loop(model, first)
    loop.run(300, np.array([26.0]))
    second = MpcController(design_for(model), ControlMode.UNAWARE)
    second.take_over(loop.history)
    assert second.observer.state == pytest.approx(first.observer.state, abs=1e-9)
    assert second.observer.disturbance == pytest.approx(first.observer.disturbance, abs=1e-9)


def test_taking_over_replays_only_the_last_samples_into_the_observer() -> None:
    model = first_order()
    design = dataclasses.replace(design_for(model), hand_over_samples=5)
    loop = Loop(model, MpcController(design, ControlMode.UNAWARE))
    loop.run(40, np.array([26.0]))
    history = loop.history
    spoilt = History(history.op, history.pv.copy(), history.dv)
    spoilt.pv[:30] = 1e6
    successor = MpcController(design, ControlMode.UNAWARE)
    successor.take_over(spoilt)
    assert np.abs(successor.observer.disturbance).max() < 100.0


def test_without_friction_the_modes_that_know_of_it_refuse_or_do_the_same() -> None:
    model = first_order()
    with pytest.raises(InputError):
        MpcController(design_for(model), ControlMode.EMBEDDING, (None,))
    design = design_for(model)
    runs = []
    for mode in (ControlMode.UNAWARE, ControlMode.INVERSION):
        loop = Loop(model, MpcController(design, mode, (None,)))
        loop.run(50, np.array([24.0]))
        runs.append(np.array(loop.op))
    assert np.array_equal(*runs)


def test_hold_keeps_what_was_applied() -> None:
    controller = MpcController(design_for(first_order()), ControlMode.HOLD)
    result = controller.step(np.array([10.0]), np.array([30.0]), NO_DV, np.array([47.0]))
    assert (result.op.tolist(), result.status, result.plan) == ([47.0], StepStatus.HELD, None)
    assert result.mode is ControlMode.HOLD


def test_an_unreachable_set_point_is_a_status_with_its_miss() -> None:
    controller = MpcController(design_for(first_order()), ControlMode.UNAWARE)
    result = controller.step(np.array([20.0]), np.array([60.0]), NO_DV, np.array([50.0]))
    assert result.status is StepStatus.UNREACHABLE
    assert result.miss == pytest.approx([15.0])
    assert "reach" in result.reason


@pytest.mark.parametrize("mode", list(ControlMode))
@pytest.mark.parametrize("which", ["pv", "sp"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_value_that_is_not_finite_does_no_lasting_harm(
    mode: ControlMode, which: str, bad: float
) -> None:
    model = first_order()
    controller = MpcController(design_for(model), mode, (FRICTION,))
    good, wrong = np.array([21.0]), np.array([bad])
    for first in (True, False):  # also as the first sample of all
        given_values = {"pv": good, "sp": good} | {which: wrong}
        result = controller.step(given_values["pv"], given_values["sp"], NO_DV, np.array([50.0]))
        without_plan = first or mode is ControlMode.HOLD
        assert result.status is (StepStatus.HELD if without_plan else StepStatus.SHIFTED)
        assert result.op == pytest.approx([50.0], abs=5.0)
        after = controller.step(good, good, NO_DV, np.array([50.0]))
        expected = StepStatus.HELD if mode is ControlMode.HOLD else StepStatus.SOLVED
        assert after.status is expected, first
        assert np.isfinite(controller.observer.state).all()
        assert np.isfinite(controller.observer.disturbance).all()


def test_the_same_inputs_give_the_same_outputs_bit_for_bit() -> None:
    model = stable_model(3, 3, 2, 2)
    runs = []
    for _ in range(2):
        controller = MpcController(design_for(model), ControlMode.EMBEDDING, (FRICTION, None))
        loop = Loop(model, controller, FRICTION)
        for sp in ([1.0, 0.0], [-2.0, 3.0]):
            loop.run(40, np.array(sp))
        runs.append(np.array(loop.op))
    assert np.array_equal(*runs)


def test_rate_limits_hold_from_sample_to_sample() -> None:
    model = first_order()
    loop = Loop(model, MpcController(design_for(model, move=1.5), ControlMode.UNAWARE))
    loop.run(30, np.array([40.0]))
    op = np.array(loop.op)[:, 0]
    assert np.abs(np.diff(op, prepend=50.0)).max() <= 1.5 + 1e-9


def test_one_wild_measurement_does_not_drive_the_loop_away() -> None:
    model = first_order()
    controller = MpcController(design_for(model), ControlMode.UNAWARE)
    loop = Loop(model, controller)
    loop.run(100, np.array([24.0]))
    quiet = loop.applied.copy()
    wild = controller.step(np.array([1e6]), np.array([24.0]), NO_DV, loop.applied)
    assert wild.op == pytest.approx(quiet, abs=0.5)
    assert "held back" in wild.reason
    after = controller.step(np.array([24.0]), np.array([24.0]), NO_DV, wild.op)
    assert after.op == pytest.approx(quiet, abs=0.5)
    assert after.reason == ""


def test_a_lasting_change_of_the_measurement_passes_after_a_few_samples() -> None:
    model = first_order()
    loop = Loop(model, MpcController(design_for(model), ControlMode.UNAWARE))
    loop.run(100, np.array([24.0]))
    loop.disturbance = 8.0  # sixty standard deviations of the noise
    loop.run(200, np.array([24.0]))
    assert loop.pv[-1] == pytest.approx([24.0], abs=1e-3)


def test_op_at_its_limit_leaves_it_at_once_when_the_set_point_comes_back() -> None:
    model = first_order()
    loop = Loop(model, MpcController(design_for(model), ControlMode.UNAWARE))
    loop.run(300, np.array([90.0]))  # far out of reach
    assert loop.op[-1] == pytest.approx([100.0])
    loop.run(3, np.array([30.0]))
    assert loop.op[-3][0] < 99.0
    assert loop.op[-1][0] < 80.0


def test_a_measured_disturbance_is_met_before_it_shows() -> None:
    model = dataclasses.replace(first_order(), e=np.array([[0.3]]))
    ops = []
    for upset in (0.0, 2.0):
        controller = MpcController(design_for(model), ControlMode.UNAWARE)
        pv = model.pv0
        result = controller.step(pv, pv, np.array([upset]), np.array([50.0]))
        ops.append(float(result.op[0]))
    assert ops[0] == pytest.approx(50.0)
    assert ops[1] < 49.0


def test_a_lost_disturbance_measurement_keeps_the_last_one() -> None:
    model = dataclasses.replace(first_order(), e=np.array([[0.3]]))
    controller = MpcController(design_for(model), ControlMode.UNAWARE)
    controller.step(model.pv0, model.pv0, np.array([2.0]), np.array([50.0]))
    state = controller.observer.state.copy()
    result = controller.step(model.pv0, model.pv0, np.array([np.nan]), np.array([50.0]))
    assert "disturbance" in result.reason
    held = model.a @ state + model.b @ (result.op - 50.0) + 0.6
    gained = controller.observer.state - held
    assert np.abs(gained).max() < 0.6  # the correction by pv, not the loss of the disturbance


@pytest.mark.parametrize("mode", [ControlMode.UNAWARE, ControlMode.EMBEDDING])
def test_a_preview_of_what_holds_anyway_changes_nothing(mode: ControlMode) -> None:
    model, sp = first_order(), np.array([24.0])
    ops = []
    for preview in (None, np.tile(sp, (3, 1)), np.zeros((0, 1))):
        controller = MpcController(design_for(model), mode, (FRICTION,))
        ops.append(controller.step(model.pv0, sp, NO_DV, model.stem0, preview).op[0])
    assert len(set(ops)) == 1


def test_with_a_preview_the_loop_is_nearer_to_its_set_points() -> None:
    model = first_order()
    schedule = np.repeat([[20.0], [24.0], [19.0]], 40, axis=0)
    errors = []
    for known in (False, True):
        controller = MpcController(design_for(model), ControlMode.UNAWARE)
        x, applied, error = np.zeros(1), np.array([50.0]), 0.0
        for k, sp in enumerate(schedule):
            pv = model.c @ x + model.pv0
            preview = schedule[k + 1 :] if known else None
            applied = controller.step(pv, sp, NO_DV, applied, preview).op
            x = model.a @ x + model.b @ (applied - 50.0)
            error += abs(float(pv[0] - sp[0]))
        errors.append(error)
    assert errors[1] < 0.6 * errors[0]


def test_a_valve_that_cannot_move_leaves_the_target_to_the_others() -> None:
    model = stable_model(3, 3, 2, 1)
    known = (HeStiction(150.0, 1.0), None)
    controller = MpcController(design_for(model), ControlMode.EMBEDDING, known)
    result = controller.step(model.pv0, model.pv0 + 0.5, NO_DV, np.array([50.0, 50.0]))
    assert "valve 1 cannot be moved" in result.reason
    assert result.op[0] == 50.0
    assert result.op[1] != 50.0
    assert result.status is StepStatus.SOLVED


def test_slack_of_soft_outputs_is_told() -> None:
    model = first_order()
    design = design_for(model, low=50.0, output=(-np.inf, 22.0))
    controller = MpcController(design, ControlMode.UNAWARE)
    result = controller.step(np.array([24.0]), np.array([21.0]), NO_DV, np.array([58.0]))
    assert result.slack[0] > 0.5
    inside = MpcController(design, ControlMode.UNAWARE).step(
        np.array([20.0]), np.array([20.0]), NO_DV, np.array([50.0])
    )
    assert inside.slack == pytest.approx([0.0], abs=1e-6)


def test_the_optimality_gap_is_told_when_it_is_asked_for() -> None:
    model = first_order()
    gaps = []
    for samples in (0, 7):
        design = dataclasses.replace(design_for(model), gap_samples=samples)
        controller = MpcController(design, ControlMode.EMBEDDING, (FRICTION,))
        controller.step(np.array([20.0]), np.array([21.0]), NO_DV, np.array([50.0]))
        result = controller.step(np.array([20.1]), np.array([24.0]), NO_DV, np.array([50.0]))
        gaps.append(result.optimality_gap)
    assert gaps[0] is None
    assert gaps[1] is not None
    assert 0.0 <= gaps[1] < 0.2


def test_an_unknown_start_is_found_by_the_first_far_jump() -> None:
    model = first_order()
    controller = MpcController(design_for(model), ControlMode.EMBEDDING, (FRICTION,))
    loop = Loop(model, controller, FRICTION)
    loop.stem = np.array([44.0])
    loop.run(2, np.array([25.0]))
    assert np.diff(controller.valves.intervals(controller.stem)[0])[0] == pytest.approx(
        0.0, abs=1e-9
    )
    assert controller.stem == pytest.approx(loop.stem, abs=1e-9)
