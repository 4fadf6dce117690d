"""Waiting for a disturbance on its way, and jumps that did not come."""

import dataclasses

import numpy as np
import pytest
from loops import design_of, first_order, limits_for, weights_for

from stiction_ros.control import ControlDesign, ControlMode, History, MpcController
from stiction_ros.control.observer import ObserverKind, ObserverTuning
from stiction_ros.control.slip_check import FREE, REST, Passage
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


STEM, SP = np.array([50.0]), np.array([7.5, 42.0])


def settled(longest: int = 20) -> Passage:
    """At rest, behind the first samples."""
    passage = Passage(longest)
    for _ in range(REST + 1):
        passage.take_in(np.zeros(2))
        assert not passage.waits(STEM, SP)
    return passage


def fed(passage: Passage, lean: float, samples: int, stem: np.ndarray = STEM) -> list[bool]:
    found = []
    for _ in range(samples):
        passage.take_in(np.array([lean, 0.0]))
        found.append(passage.waits(stem, SP))
    return found


@pytest.mark.parametrize("lean", [1.5, -1.5])
def test_a_stem_at_rest_waits_while_innovations_lean_and_not_for_ever(lean: float) -> None:
    waits = fed(settled(longest=6), lean, 14)
    assert sum(waits) == 6
    first = waits.index(True)
    assert 0 < first <= 4
    assert waits[first : first + 6] == [True] * 6


def test_it_waits_anew_once_innovations_have_been_even() -> None:
    passage = settled(longest=6)
    fed(passage, 1.5, 14)
    assert not any(fed(passage, 0.0, 20)[-5:])
    assert sum(fed(passage, 1.5, 14)) == 6


def test_white_innovations_seldom_make_it_wait() -> None:
    random, passage = np.random.default_rng(3), settled()
    waits = []
    for _ in range(2000):
        passage.take_in(random.normal(size=1))
        waits.append(passage.waits(STEM, SP))
    assert 0 < np.mean(waits) < 0.3


def test_a_stem_that_has_just_jumped_is_free_to_jump_back() -> None:
    passage = settled()
    fed(passage, 1.5, 5)
    away = STEM + 9.0
    assert fed(passage, 1.5, REST, away) == [False] * REST
    assert fed(passage, 1.5, 1, away) == [True]


def test_a_set_point_move_is_answered_at_once() -> None:
    passage = settled()
    assert fed(passage, 1.5, 8)[-1]
    moved = SP + 0.1
    found = []
    for _ in range(FREE + 1):
        passage.take_in(np.array([1.5, 0.0]))
        found.append(passage.waits(STEM, moved))
    assert found == [False] * FREE + [True]


def test_one_wild_innovation_counts_for_four_deviations() -> None:
    """It makes a stem wait for a few samples, not for as long as it allows."""
    passage = settled(longest=100)
    waits = fed(passage, 1e6, 1) + fed(passage, 0.0, 30)
    assert 0 < sum(waits) <= 5


def test_without_a_longest_wait_it_never_waits() -> None:
    assert not any(fed(settled(longest=0), 4.0, 20))
