"""A run that was cut is judged by the schedule that its plant announced."""

import dataclasses

import numpy as np
import pytest

from stiction_ros.effects import Backlash, FrictionPair, SlipJumpPair, behaviours
from stiction_ros.identification.friction import behaviour_of
from stiction_ros.records.record import Record
from stiction_ros.records.run.events import ModeChange, Text
from stiction_ros.records.run.log import RunLog
from stiction_ros.report.run.scoring import PhaseStatus
from stiction_ros.report.run.story import round_of, tell

ROUND, SWAP = 200, 230


def cut_run(samples: int, config: str) -> RunLog:
    """Return a cycling run with set-points that repeat every 200 samples, cut anywhere."""
    k = np.arange(samples)
    sp = np.where(k % ROUND < 100, 1.0, 2.0)[:, None]
    cycle = np.where(k < SWAP, 0.3, 0.01) * np.sin(2 * np.pi * k / 12)
    record = Record(
        "cut", 2.0, ("V",), ("P",), op=np.zeros((samples, 1)), pv=sp + cycle[:, None], sp=sp
    )
    modes = (ModeChange(0, "unaware"), ModeChange(SWAP * 2 * 10**9, "embedding"))
    configs = (Text("/plant/config", 0, config),)
    return RunLog(record, 0, modes, (), configs, {}, {})


ANNOUNCED = "{node: /plant, seed: 1, set_points: {repeat: 400.0, moves: []}}"


@pytest.mark.parametrize(
    ("samples", "status"),
    [(300, PhaseStatus.NO_ROUND), (390, PhaseStatus.NO_ROUND), (600, PhaseStatus.OK)],
)
def test_the_announced_round_decides(samples: int, status: PhaseStatus) -> None:
    assert tell(cut_run(samples, ANNOUNCED)).phases.status is status


@pytest.mark.parametrize("config", ["{", "- 1", "{node: 3}", "{node: /plant, set_points: []}"])
def test_a_configuration_that_says_nothing_tells_no_round(config: str) -> None:
    assert round_of(cut_run(600, config), None) is None


def test_a_cut_at_the_swap_is_no_swap() -> None:
    log = cut_run(SWAP, ANNOUNCED)
    story = tell(log)
    assert (story.swap_time, story.phases.status) == (None, PhaseStatus.NO_SWAP)
    assert dataclasses.replace(log, modes=()).swap is None


@pytest.mark.parametrize("law", ["he", "kano", "xch", "semi_physical", "choudhury"])
def test_the_friction_of_the_plant_is_told_whatever_its_law(log: RunLog, law: str) -> None:
    story = tell(log)
    assert story.truth is not None
    kind = next(kind for kind in behaviours() if kind.law == law)
    assert issubclass(kind, FrictionPair | SlipJumpPair)
    truth = story.truth.with_valve_effects({"V1": (behaviour_of(law, (5.0, 2.0), {}),)})
    told = dataclasses.replace(story, truth=truth).true_friction("V1")
    assert told == pytest.approx((5.0, 2.0))


def test_a_valve_without_friction_is_told_as_such(log: RunLog) -> None:
    story = tell(log)
    assert story.truth is not None
    truth = story.truth.with_valve_effects({"V1": (Backlash(2.0),)})
    assert dataclasses.replace(story, truth=truth).true_friction("V1") == (0.0, 0.0)
