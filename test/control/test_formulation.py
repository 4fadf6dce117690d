import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.control.belief import ValveBeliefs
from stiction_ros.control.controller import MpcController
from stiction_ros.control.formulation import Formulation
from stiction_ros.control.result import ControlMode, Plan, StepResult, StepStatus
from stiction_ros.control.target import Target
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import LoopModel

STEPS = 4


class Steady(Formulation):
    """OP of the target, and nothing else."""

    mode = ControlMode.UNAWARE

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        stems = np.tile(target.stem, (STEPS, 1))
        return Plan(
            target.stem, stems, np.tile(target.pv, (STEPS + 1, 1)), np.zeros(len(target.pv))
        )


class Halted(Steady):
    """Its only valve cannot move; it judges its own plans."""

    immobile = (0,)

    def __init__(self) -> None:
        self.learned: list[FloatArray] = []

    def learn(self, valves: ValveBeliefs, stem: FloatArray) -> None:
        self.learned.append(valves.intervals(stem))

    def optimality_gap(
        self, state: FloatArray, target: Target, last: FloatArray, plan: Plan, samples: int
    ) -> float | None:
        return 0.25 * samples


def _step(
    monkeypatch: pytest.MonkeyPatch, formulation: Formulation
) -> tuple[StepResult, LoopModel]:
    monkeypatch.setattr("stiction_ros.control.controller.formulation_of", lambda *_: formulation)
    model = LoopModel.load(find_config("example1_process.loop.yaml"))
    design = ControlSettings(horizon=30, gap_samples=2).design(model)
    controller = MpcController(design, ControlMode.UNAWARE)
    controller.start(model.stem_start, model.pv_start)
    return controller.step(model.pv0, model.pv0 + 2.0, np.zeros(0), model.op0), model


def test_a_plan_is_all_that_a_formulation_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    result, model = _step(monkeypatch, Steady())
    assert result.status is StepStatus.SOLVED
    assert not result.reason
    assert result.optimality_gap is None
    assert result.plan is not None
    assert result.op == pytest.approx(result.plan.stem[0])
    assert result.plan.pv[-1] == pytest.approx(model.pv0 + 2.0)


def test_what_a_formulation_says_beyond_its_plan_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    halted = Halted()
    result, model = _step(monkeypatch, halted)
    assert [interval.tolist() for interval in halted.learned] == [[[50.0, 50.0]]]
    assert result.status is StepStatus.UNREACHABLE  # no stem but the present one is allowed
    assert result.op == pytest.approx(model.op0)
    assert "V1 cannot be moved" in result.reason
    assert result.optimality_gap == 0.5
