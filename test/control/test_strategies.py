import dataclasses
from typing import Any

import numpy as np
import pytest
from loops import design_of, first_order, kalman, limits_for, weights_for

from stiction_ros.control import ControlDesign, ControlMode, MpcController, StepStatus
from stiction_ros.control.result import Plan, StepResult
from stiction_ros.control.strategies import FallbackRule, Strategies
from stiction_ros.control.target import Target
from stiction_ros.effects import HeStiction

FRICTION = HeStiction(8.0, 1.0)
NO_DV = np.zeros(0)
PV, SP = np.array([20.0]), np.array([24.0])


class Switched:
    """A formulation that can be told to fail."""

    mode = ControlMode.EMBEDDING

    def __init__(self, stems: list[float]) -> None:
        self.stems, self.works, self.converged = stems, True, True

    def plan(self, state: np.ndarray, target: Target, last: np.ndarray) -> Plan | None:
        if not self.works:
            return None
        stem = np.array(self.stems)[:, None]
        return Plan(
            stem[0].copy(), stem, np.zeros((len(stem) + 1, 1)), np.zeros(1), 0, self.converged
        )


def design(**rule: Any) -> ControlDesign:
    model = first_order()
    made = design_of(model, limits_for(model, 10.0, 90.0), weights_for(model, 8), kalman(1))
    return dataclasses.replace(made, fallback=FallbackRule(**rule))


def controller(
    mine: Switched, standing_in: Switched | None, mode: ControlMode, **rule: Any
) -> MpcController:
    """A controller whose formulation and stand-in are these."""
    frictions = (FRICTION,) if mode is ControlMode.EMBEDDING else (None,)
    made = MpcController(design(**rule), mode, frictions)
    made._strategies = Strategies(mine, standing_in, made.design.fallback)
    return made


def step(it: MpcController, applied: float, pv: np.ndarray = PV) -> StepResult:
    return it.step(pv, SP, NO_DV, np.array([applied]))


def test_a_solved_plan_is_applied() -> None:
    result = step(controller(Switched([55.0] * 8), None, ControlMode.UNAWARE), 50.0)
    assert (result.status, result.strategy, result.age) == (StepStatus.SOLVED, "solve", 0)
    assert (result.op.tolist(), result.reason) == ([55.0], "")


def test_an_unfinished_plan_is_said_to_be_one() -> None:
    mine = Switched([55.0] * 8)
    mine.converged = False
    result = step(controller(mine, None, ControlMode.UNAWARE), 50.0)
    assert (result.status, result.strategy) == (StepStatus.LIMIT, "limit")
    assert "iterations" in result.reason
    assert result.op.tolist() == [55.0]


def test_a_lost_solution_is_followed_by_the_rest_of_the_last_plan() -> None:
    mine = Switched([55.0, 56.0, 57.0, 58.0, 59.0, 60.0, 61.0, 62.0])
    it = controller(mine, None, ControlMode.UNAWARE, hold_after=3)
    step(it, 50.0)
    mine.works = False
    results = [step(it, 70.0) for _ in range(4)]
    assert [r.op[0] for r in results] == [56.0, 57.0, 58.0, 70.0]
    assert [r.age for r in results] == [1, 2, 3, 0]
    assert [r.strategy for r in results] == ["shift"] * 3 + ["hold"]
    assert "2 samples old" in results[1].reason


def test_a_plan_is_not_followed_beyond_its_end() -> None:
    mine = Switched([55.0, 56.0])
    it = controller(mine, None, ControlMode.UNAWARE, hold_after=9)
    step(it, 50.0)
    mine.works = False
    assert [step(it, 70.0).strategy for _ in range(3)] == ["shift", "hold", "hold"]


def test_a_shifted_jump_is_the_op_that_makes_it() -> None:
    mine = Switched([50.0, 62.0, 62.0, 51.0])
    it = controller(mine, None, ControlMode.EMBEDDING)
    step(it, 50.0)
    mine.works = False
    assert step(it, 50.0).op.tolist() == [63.0]  # 62 and f_D
    assert step(it, 63.0).op.tolist() == [62.0]  # rests at the stem
    assert step(it, 62.0).op.tolist() == [50.0]  # 51 less f_D


def test_then_the_unaware_controller_stands_in() -> None:
    mine, other = Switched([55.0] * 8), Switched([44.0] * 8)
    it = controller(mine, other, ControlMode.EMBEDDING, hold_after=1)
    step(it, 50.0)
    mine.works = False
    assert step(it, 55.0).strategy == "shift"
    result = step(it, 55.0)
    assert (result.status, result.strategy) == (StepStatus.SUBSTITUTED, "unaware")
    assert (result.mode, result.op.tolist()) == (ControlMode.UNAWARE, [44.0])


def test_then_op_is_held_in_mode_hold() -> None:
    mine, other = Switched([55.0] * 8), Switched([44.0] * 8)
    mine.works = other.works = False
    it = controller(mine, other, ControlMode.EMBEDDING)
    results = [step(it, 47.0) for _ in range(40)]
    assert {r.strategy for r in results} == {"hold"}
    assert {r.mode for r in results} == {ControlMode.HOLD}
    assert {r.status for r in results} == {StepStatus.HELD}
    assert all(r.op.tolist() == [47.0] and r.plan is None for r in results)
    assert "no plan found" in results[-1].reason


def test_a_plan_that_is_found_again_ends_the_hold() -> None:
    mine = Switched([55.0] * 8)
    mine.works = False
    it = controller(mine, None, ControlMode.UNAWARE)
    assert step(it, 47.0).strategy == "hold"
    mine.works = True
    assert step(it, 47.0).strategy == "solve"
    mine.works = False
    assert [step(it, 47.0).strategy for _ in range(6)] == ["shift"] * 5 + ["hold"]


def fallback(after: int) -> dict[str, Any]:
    return {
        "hold_after": 1,
        "fallback_after": after,
        "fallback_op": np.array([45.0]),
        "fallback_rate": np.array([2.0]),
    }


def test_what_is_held_for_long_goes_to_its_fallback_in_steps() -> None:
    mine = Switched([50.0] * 8)
    it = controller(mine, None, ControlMode.UNAWARE, **fallback(3))
    op = [float(step(it, 50.0).op[0])]
    mine.works = False
    results = []
    for _ in range(9):
        results.append(step(it, op[-1]))
        op.append(float(results[-1].op[0]))
    assert [r.strategy for r in results] == ["shift"] + ["hold"] * 3 + ["fallback"] * 5
    assert op == [50.0] * 5 + [48.0, 46.0, 45.0, 45.0, 45.0]
    assert {r.status for r in results[4:]} == {StepStatus.FALLBACK}
    assert {r.mode for r in results[1:]} == {ControlMode.HOLD}
    assert "fallback" in results[-1].reason


def test_a_mode_that_was_asked_for_never_falls_back() -> None:
    made = MpcController(design(**fallback(1)), ControlMode.HOLD, (None,))
    assert {step(made, 47.0).strategy for _ in range(9)} == {"hold"}


def test_a_plan_that_is_found_again_ends_the_fallback() -> None:
    mine = Switched([50.0] * 8)
    it = controller(mine, None, ControlMode.UNAWARE, **fallback(1))
    mine.works = False
    assert [step(it, 50.0).strategy for _ in range(2)] == ["hold", "fallback"]
    mine.works = True
    assert step(it, 48.0).strategy == "solve"
    mine.works = False
    assert [step(it, 48.0).strategy for _ in range(2)] == ["shift", "hold"]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_op_that_is_no_number_never_leaves(bad: float) -> None:
    it = controller(Switched([bad] * 8), None, ControlMode.UNAWARE)
    result = step(it, bad)
    assert np.isfinite(result.op).all()
    assert result.status is StepStatus.HELD


def test_a_held_op_is_cut_to_the_limits() -> None:
    mine = Switched([55.0])
    mine.works = False
    assert step(controller(mine, None, ControlMode.UNAWARE), 99.0).op.tolist() == [90.0]


def test_out_of_iterations_there_is_no_plan() -> None:
    model = first_order()
    limits = dataclasses.replace(limits_for(model, 40.0, 60.0, 1.5), iterations=1)
    made = design_of(model, limits, weights_for(model, 20), kalman(1))
    result = MpcController(made, ControlMode.UNAWARE).step(
        PV, np.array([24.9]), NO_DV, np.array([50.0])
    )
    assert (result.status, result.op.tolist()) == (StepStatus.HELD, [50.0])


def test_after_a_failure_the_solver_starts_anew() -> None:
    model = first_order()
    limits = dataclasses.replace(limits_for(model, 40.0, 60.0, 1.5), iterations=4)
    it = MpcController(
        design_of(model, limits, weights_for(model, 20), kalman(1)), ControlMode.UNAWARE
    )
    qp = it._formulation._problem.qp  # type: ignore[union-attr]
    it.step(PV, np.array([24.9]), NO_DV, np.array([50.0]))
    assert qp.limit_reached
    assert not qp._hard._ready
    it.step(PV, PV, NO_DV, np.array([50.0]))
    assert qp._hard._ready
