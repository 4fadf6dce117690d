import functools

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode, History, MpcController
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects import HeStiction
from stiction_ros.loop import LoopModel, SetPoints, simulate_closed_loop
from stiction_ros.online.controller.live import LiveController
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.handover.offers import Judge, Maker, OfferRule

PLANT = LoopModel.load(find_config("example1.loop.yaml"))
PROCESS = LoopModel.load(find_config("example1_process.loop.yaml"))
MOVES = SetPoints.load(find_config("siso.set_points.yaml"), ("PV1",))
TUNING = {
    "horizon": 40,
    "move_weights": (0.1,),
    "state_noise": 0.01,
    "disturbance_noise": (1e-4,),
    "measurement_noise": (1e-4,),
}
DESIGN = ControlSettings(hand_over_samples=200, **TUNING).design(PROCESS)  # type: ignore[arg-type]
RULE = OfferRule()


def knowing(friction: HeStiction | None) -> Maker:
    mode = ControlMode.UNAWARE if friction is None else ControlMode.EMBEDDING
    return functools.partial(MpcController, DESIGN, mode, (friction,), (None,))


TRUE, NONE = knowing(HeStiction(5.0, 2.0)), knowing(None)


def past(plant: LoopModel, samples: int, seed: int = 5) -> History:
    """The unaware loop on ``plant``."""
    live = LiveController(LiveControllerSettings(**TUNING), PROCESS)  # type: ignore[arg-type]
    run = simulate_closed_loop(
        plant, lambda now, sp: live.step(now.pv, sp).op, MOVES, samples, seed
    ).record
    return History(run.op, run.pv, np.zeros((samples, 0)))


def joined(one: History, other: History) -> History:
    return History(*(np.concatenate(pair) for pair in zip(one_of(one), one_of(other), strict=True)))


def one_of(history: History) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return history.op, history.pv, history.dv


@functools.cache
def cycle() -> History:
    """The loop whose valve sticks."""
    return past(PLANT, 1000)


@functools.cache
def calm() -> History:
    """The loop whose valve is ideal."""
    return past(PROCESS, 300)


def test_the_true_friction_is_not_doubted_by_a_cycle() -> None:
    assert Judge(RULE, NONE).doubt(TRUE, cycle()) == ""


@pytest.mark.parametrize("poison", [(60.0, 59.0), (20.0, 1.0), (30.0, 22.8), (1.0, 0.9)])
@pytest.mark.parametrize("in_force", [NONE, TRUE])
def test_a_friction_far_from_the_true_one_is_doubted(
    poison: tuple[float, float], in_force: Maker
) -> None:
    assert Judge(RULE, in_force).doubt(knowing(HeStiction(*poison)), cycle())


@pytest.mark.parametrize("samples", [1, 199])
def test_a_short_past_speaks_for_nothing(samples: int) -> None:
    short = History(*(rows[:samples] for rows in one_of(cycle())))
    assert f"only {samples} samples" in Judge(RULE, NONE).doubt(TRUE, short)


def test_a_friction_by_which_the_valve_never_moved_is_doubted() -> None:
    still = History(np.full((400, 1), 50.0), np.full((400, 1), 50.0), np.zeros((400, 0)))
    assert "slipped 0 times" in Judge(RULE, NONE).doubt(TRUE, still)


def test_a_model_that_says_since_when_it_holds_is_judged_by_these_samples() -> None:
    history = joined(cycle(), calm())
    assert "no better" in Judge(OfferRule(offer_ratio=1.1), TRUE).doubt(NONE, history)
    assert Judge(RULE, TRUE, last_samples=250).doubt(NONE, history) == ""
    grown = knowing(HeStiction(7.5, 2.0))
    assert "no better" in Judge(RULE, TRUE, last_samples=900).doubt(grown, cycle())


def test_the_friction_in_force_is_never_doubted() -> None:
    short = History(*(rows[:5] for rows in one_of(cycle())))
    assert Judge(RULE, TRUE).doubt(TRUE, short) == ""


def test_a_friction_of_a_healthy_valve_must_earn_itself_whatever_it_says_of_since_when() -> None:
    poison = knowing(HeStiction(20.0, 1.0))
    assert Judge(RULE, NONE, last_samples=1).doubt(poison, cycle())
    assert Judge(RULE, NONE, last_samples=10**30).doubt(poison, cycle())


def test_what_was_rolled_back_is_not_judged_by_its_own_samples_alone() -> None:
    judge = Judge(RULE, TRUE, offered_before=True, last_samples=250)
    assert "rolled back before" in judge.doubt(NONE, joined(cycle(), calm()))
