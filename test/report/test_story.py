"""A run that was cut is judged by the schedule that its plant announced."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from stiction_ros.records.record import Record
from stiction_ros.records.run_log import ModeChange, RunLog, Text
from stiction_ros.report.scoring import PhaseStatus
from stiction_ros.report.story import round_of, tell

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
    return RunLog(record, 0, (), modes, (), configs, (), {}, {})


ANNOUNCED = "{node: /plant, seed: 1, set_points: {repeat: 400.0, moves: []}}"


@pytest.mark.parametrize(
    ("samples", "status"),
    [(300, PhaseStatus.NO_ROUND), (390, PhaseStatus.NO_ROUND), (600, PhaseStatus.OK)],
)
def test_the_announced_round_decides(samples: int, status: PhaseStatus) -> None:
    assert tell(cut_run(samples, ANNOUNCED)).phases.status is status


def test_without_it_the_recorded_moves_stand_in() -> None:
    assert round_of(cut_run(600, "{node: /plant}"), None) == ROUND
    assert round_of(cut_run(300, "{node: /plant}"), None) is None


@pytest.mark.parametrize("config", ["{", "- 1", "{node: 3}", "{node: /plant, set_points: []}"])
def test_a_configuration_that_says_nothing_is_passed_over(config: str) -> None:
    assert round_of(cut_run(600, config), None) == ROUND


def test_a_cut_at_the_swap_is_no_swap() -> None:
    log = cut_run(SWAP, ANNOUNCED)
    story = tell(log)
    assert (story.swap_time, story.phases.status) == (None, PhaseStatus.NO_SWAP)
    assert dataclasses.replace(log, modes=()).swap is None
