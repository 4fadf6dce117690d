"""Set-points that no record holds, and the law that tells them."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record, without_controller, without_set_points

from stiction_ros.discrepancy.data.controller_check import (
    ControllerStatus,
    check_controller,
    unseen_of,
)
from stiction_ros.discrepancy.data.set_point import told_set_points
from stiction_ros.discrepancy.simulation.free_run import join_records
from stiction_ros.loop import PiTuning
from stiction_ros.records import Record


def with_op(recorded: Record, op: np.ndarray) -> Record:
    return without_set_points(dataclasses.replace(recorded, op=op))


@pytest.mark.parametrize("records", [1, 2])
def test_a_set_point_at_rest_is_told_to_its_digits(records: int) -> None:
    recorded = [record(loop(), seed) for seed in range(1, records + 1)]
    runs = join_records(loop(), [without_set_points(each) for each in recorded])
    told = told_set_points(loop(), runs, 1)
    assert told is not None
    for found, true in zip(told.runs.records, recorded, strict=True):
        assert found.sp is not None
        assert true.sp is not None
        assert found.sp[1:] == pytest.approx(true.sp[1:], abs=1e-6)


def test_a_set_point_that_never_moves_is_told() -> None:
    runs = join_records(loop(), [without_set_points(record(loop(), moves=False))])
    told = told_set_points(loop(), runs, 1)
    assert told is not None
    assert told.runs.records[0].sp == pytest.approx(50.0, abs=1e-6)


@pytest.mark.parametrize("known", [True, False])
def test_the_controller_is_recognised_and_nothing_acts_beside_its_op(known: bool) -> None:
    model = loop() if known else without_controller(loop())
    runs = join_records(model, [without_set_points(record(loop()))])
    check = check_controller(model, runs)
    assert check.status is ControllerStatus.SAME
    assert check.clock_known
    assert unseen_of(runs, check) == ((),)


def test_a_tuning_that_is_not_the_given_one_tells_no_set_point() -> None:
    other = dataclasses.replace(loop(), controller=PiTuning(1.1, 9.0))
    runs = join_records(loop(), [without_set_points(record(other))])
    assert check_controller(loop(), runs).status is ControllerStatus.NOT_ASKED


@pytest.mark.parametrize("hand", ["steps", "walk"])
def test_op_of_an_operator_follows_no_set_point(hand: str) -> None:
    recorded = record(loop())
    random = np.random.default_rng(1)
    moves = random.normal(0.0, 0.3, recorded.op.shape)
    if hand == "steps":
        moves[np.arange(len(moves)) % 60 != 0] = 0.0
    runs = join_records(loop(), [with_op(recorded, 50.0 + np.cumsum(moves, axis=0))])
    assert check_controller(loop(), runs).status is ControllerStatus.NOT_ASKED
