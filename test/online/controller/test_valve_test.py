"""A valve test in a running loop: what ends it, and who has OP then."""

import dataclasses

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode
from stiction_ros.loop import LoopModel, Plant
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.controller.testing import ValveTestingController

PLANT = LoopModel.load(find_config("flow.loop.yaml"))
PROCESS = PLANT.with_ideal_valves()
SETTINGS = LiveControllerSettings(
    mode="valve_test",
    valve_test_at=30,
    horizon=40,
    move_weights=(0.1,),
    measurement_noise=(2.5e-3,),
)
SP = np.array([40.0])


class Run:
    """The sticky flow loop under a controller that tests its valve."""

    def __init__(self, settings: LiveControllerSettings = SETTINGS, seed: int = 1) -> None:
        self.live = ValveTestingController(settings, PROCESS)
        self.plant = Plant(PLANT, seed)
        self.op: list[float] = []

    def go(self, samples: int, sp: np.ndarray = SP, pv: float | None = None) -> None:
        for _ in range(samples):
            measured = self.plant.measure().pv if pv is None else np.array([pv])
            op = self.live.step(measured, sp).op
            self.plant.apply(op)
            self.op.append(float(op[0]))

    @property
    def told(self) -> str:
        return self.live.changes[-1].reason


@pytest.fixture
def tested() -> Run:
    """A loop in the middle of the first hold of its test."""
    run = Run()
    run.go(35)
    assert run.live.mode is ControlMode.VALVE_TEST
    assert run.live.changes[-1].sample == 30
    assert len(set(run.op[30:])) == 1  # OP rests where it was
    return run


def test_it_begins_without_a_bump(tested: Run) -> None:
    assert tested.op[30] == tested.op[29]


def test_a_set_point_move_ends_it(tested: Run) -> None:
    tested.go(1, sp=SP + 2.0)
    assert tested.told == "valve test: the set-point moved"
    assert tested.live.mode is ControlMode.UNAWARE
    assert abs(tested.op[-1] - tested.op[-2]) <= 0.9 + 1e-9


def test_a_bad_pv_ends_it_and_op_goes_back(tested: Run) -> None:
    tested.go(1, pv=float("nan"))
    assert tested.told == "valve test: PV is bad"
    assert tested.op[-1] == tested.op[30]


def test_pv_at_its_limit_ends_it(tested: Run) -> None:
    tested.go(1, pv=80.0)
    assert tested.told.startswith("valve test: PV 80 goes beyond")
    assert tested.op[-1] == tested.op[30]


def test_what_pv_showed_up_to_its_limit_is_judged() -> None:
    run = Run()
    run.go(31)
    test = run.live.test
    assert test is not None
    run.go(5 * test.hold)
    moves, last = test.moves, test.judgement
    assert moves > 2
    run.go(1, pv=80.0)
    assert test.over.startswith("PV 80 goes beyond")
    assert test.judgement is not last
    assert run.op[-1] == test.facts.op


def test_a_late_sample_ends_it(tested: Run) -> None:
    tested.live.pass_over(np.array([np.nan]))
    assert tested.told == "valve test: a sample was late or bad"
    assert tested.live.mode is ControlMode.UNAWARE


def test_a_take_over_ends_it_and_op_stays_with_the_operator(tested: Run) -> None:
    tested.live.applied(np.array([55.0]), ours=False)
    tested.go(1)
    assert tested.told == "valve test: someone else has OP"
    assert abs(tested.op[-1] - 55.0) <= 0.9 + 1e-9


def test_another_mode_ends_it(tested: Run) -> None:
    tested.live.retune(dataclasses.replace(SETTINGS, mode="unaware"))
    assert tested.told == "valve test: the mode was set"


def test_the_mode_set_again_begins_another(tested: Run) -> None:
    tested.live.retune(dataclasses.replace(SETTINGS, mode="auto"))
    tested.go(2)
    assert tested.live.mode is not ControlMode.VALVE_TEST
    tested.live.retune(SETTINGS)
    tested.go(1)
    assert tested.live.mode is ControlMode.VALVE_TEST


FAULTS = {
    "NaN": lambda run: run.go(1, pv=float("nan")),
    "late": lambda run: run.live.pass_over(np.array([np.nan])),
    "set-point": lambda run: run.go(1, sp=SP + 2.0),
    "take-over": lambda run: run.live.applied(np.array([run.op[-1] + 3.0]), ours=False),
    "PV": lambda run: run.go(1, pv=80.0),
}


@pytest.mark.parametrize(
    "seed", [*range(2), *(pytest.param(seed, marks=pytest.mark.trial) for seed in range(2, 50))]
)
def test_a_fault_at_any_time_leaves_the_former_controller_without_a_bump(seed: int) -> None:
    random = np.random.default_rng(seed)
    run = Run(seed=seed)
    run.go(31 + int(random.integers(1, 60)))
    name = str(random.choice(list(FAULTS)))
    assert run.live.mode is ControlMode.VALVE_TEST
    moves = np.abs(np.array(run.op[30:]) - run.op[30])
    assert moves.max() <= SETTINGS.valve_test_op
    before = run.op[-1] + (3.0 if name == "take-over" else 0.0)
    FAULTS[name](run)
    if name in ("NaN", "PV"):  # OP goes back first
        before = run.op[-1]
    if name != "set-point":
        run.go(1)
    assert run.live.mode is ControlMode.UNAWARE
    assert abs(run.op[-1] - before) <= 0.9 + 1e-9


@pytest.mark.trial
def test_a_sticky_valve_is_found_and_the_former_controller_goes_on() -> None:
    run, again = Run(), Run()
    run.go(600)
    test = run.live.test
    assert test is not None
    assert test.judgement is not None
    assert test.judgement.verdict.has_friction
    assert test.judgement.f_s_interval[0] <= 4.0 <= test.judgement.f_s_interval[1]
    ended = next(c.sample for c in run.live.changes if c.reason.startswith("valve test: "))
    assert run.op[ended - 1] == test.facts.op
    assert abs(run.op[ended] - run.op[ended - 1]) <= 0.9 + 1e-9
    moves = np.abs(np.array(run.op[30:ended]) - test.facts.op)
    assert moves.max() <= SETTINGS.valve_test_op
    again.go(600)
    assert again.op == run.op  # bit for bit
