import dataclasses

import numpy as np
import pytest
from loops import design_of, first_order, limits_for, weights_for

from stiction_ros.control import ControlDesign, ControlMode, History, MpcController
from stiction_ros.control.observer import ObserverKind, ObserverTuning
from stiction_ros.effects import HeStiction

BELIEVED = HeStiction(8.0, 1.0)
NOISE = 0.02
NO_DV = np.zeros(0)


def design(**changes: object) -> ControlDesign:
    model = first_order()
    quiet = ObserverTuning(ObserverKind.KALMAN, 0.1, np.full(1, 1e-4), np.full(1, NOISE**2))
    made = design_of(model, limits_for(model), weights_for(model, 20), quiet)
    return dataclasses.replace(made, **changes)  # type: ignore[arg-type]


class StickyLoop:
    """First-order process, a valve that sticks more than is believed, measurement noise."""

    def __init__(self, controller: MpcController, true: HeStiction, seed: int = 3) -> None:
        self.controller, self.true = controller, true
        self.random = np.random.default_rng(seed)
        self.model = controller.design.model
        self.x, self.stem, self.applied = np.zeros(1), 50.0, np.array([50.0])
        self.said: list[str] = []
        self.error: list[float] = []

    def run(self, samples: int, sp: float) -> None:
        for _ in range(samples):
            clean = self.model.c @ self.x + self.model.pv0
            pv = clean + NOISE * self.random.normal(size=1)
            result = self.controller.step(pv, np.array([sp]), NO_DV, self.applied)
            self.applied = result.op
            self.stem = self.true.step(self.stem, float(result.op[0]))[1]
            self.x = self.model.a @ self.x + self.model.b @ (np.array([self.stem]) - 50.0)
            self.error.append(abs(float(clean[0]) - sp))
            if self.controller.raised:
                self.said.append(self.controller.raised)


def sure(controller: MpcController) -> MpcController:
    """Let the controller be sure of its stem at 50 %: a far move up and one back."""
    rest = controller.design.model.pv0
    op = np.array([[50.0], [90.0], [49.0]] + [[49.0]] * 300)
    controller.take_over(History(op, np.tile(rest, (len(op), 1)), np.zeros((len(op), 0))))
    belief = controller.valves[0]
    assert belief is not None
    assert belief.sure
    belief.settle(50.0)
    controller.stem = np.array([50.0])
    return controller


def loop(true: float, **changes: object) -> StickyLoop:
    controller = MpcController(design(**changes), ControlMode.EMBEDDING, (BELIEVED,))
    return StickyLoop(sure(controller), HeStiction(true, 1.0))


def believed(run: StickyLoop) -> float:
    friction = run.controller.frictions[0]
    assert isinstance(friction, HeStiction)
    return friction.static_friction


def test_a_jump_that_fails_raises_static_friction() -> None:
    run = loop(12.0)
    run.run(60, 23.0)
    assert len(run.said) == 1
    assert "valve 1 stayed" in run.said[0]
    assert 8.0 < believed(run) <= 12.0
    assert run.stem != 50.0, "the next jump is still too small"
    assert run.controller.stem == pytest.approx([run.stem], abs=1e-9)


def test_without_the_check_the_loop_is_worse() -> None:
    errors = []
    for check in (True, False):
        run = loop(12.0, slip_check=check)
        for sp in (23.0, 21.0, 24.0):
            run.run(100, sp)
        errors.append(np.mean(run.error))
    assert errors[0] < 0.85 * errors[1]


@pytest.mark.parametrize("seed", range(5))
def test_jumps_that_happen_raise_nothing(seed: int) -> None:
    run = loop(8.0)
    run.random = np.random.default_rng(seed)
    for sp in (23.0, 18.0, 24.5, 20.0, 16.0, 22.0):
        run.run(60, sp)
    assert run.said == []
    assert believed(run) == 8.0


@pytest.mark.parametrize("seed", range(5))
def test_a_serviced_valve_raises_nothing(seed: int) -> None:
    """Where it goes is never quite where it should, but it is far from where it was."""
    run = loop(8.0)
    run.random, run.true = np.random.default_rng(seed), HeStiction(0.0, 0.0)
    for sp in (26.0, 12.0, 28.0, 16.0):
        run.run(60, sp)
    assert run.said == []
    assert believed(run) == 8.0


def test_nothing_is_checked_before_the_first_sure_slip() -> None:
    controller = MpcController(design(), ControlMode.EMBEDDING, (BELIEVED,))
    run = StickyLoop(controller, HeStiction(60.0, 1.0))  # it never moves
    run.run(1, 20.0)
    belief = controller.valves[0]
    assert belief is not None
    assert not belief.sure
    controller.observer.rest(np.array([50.0]), np.array([20.0]))
    for _ in range(3):
        assert controller._check is not None
        controller._check.begin(0, controller.observer, belief, 65.0)
        assert controller._check._rivals == [[]]
        run.run(1, 20.0)
