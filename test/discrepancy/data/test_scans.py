"""A controller that scans twice in a sample of the record."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record, without_controller, without_set_points

from stiction_ros.discrepancy.candidate.valve import ValveCandidate, valve_candidates
from stiction_ros.discrepancy.data.controller_check import ControllerStatus, check_controller
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.data.scans import scanned_twice
from stiction_ros.discrepancy.simulation.free_run import FreeRun, Runs
from stiction_ros.effects import FloatArray, HeStiction
from stiction_ros.loop import LoopModel, PiTuning
from stiction_ros.records.record import Quality

EVERY = 2
TUNING = PiTuning(gain=0.8, integral_time=24.0)


def thinned(*, with_sp: bool = True) -> tuple[Runs, LoopModel, FloatArray]:
    """Return every other sample of a loop, its model and the mean OP of each sample."""
    document = without_controller(loop()).to_mapping()
    document["controller"] = {"kind": "pi", "gain": 0.8, "integral_time": 24.0}
    model = LoopModel.from_mapping(document)
    whole = record(model, samples=1400)
    assert whole.sp is not None
    part = dataclasses.replace(
        whole,
        sample_time=float(EVERY),
        op=whole.op[::EVERY],
        pv=whole.pv[::EVERY],
        sp=whole.sp[::EVERY],
    )
    slower = LoopModel.from_mapping(document | {"sample_time": float(EVERY)})
    runs, _ = open_gate(slower, [part if with_sp else without_set_points(part)])
    return runs, slower, whole.op[:, 0].reshape(-1, EVERY).mean(axis=1)


@pytest.mark.parametrize("known", [True, False])
def test_the_op_between_two_samples_is_told_by_those_beside_it(known: bool) -> None:
    runs, model, mean = thinned()
    found = scanned_twice(model if known else without_controller(model), runs)
    assert found is not None
    assert found.gain == pytest.approx(0.8, rel=1e-6 if known else 0.03)
    left = np.std(found.op[:-1, 0] - mean[:-1])
    assert left < (1e-6 if known else 0.2) * np.std(runs.op[:-1, 0] - mean[:-1])


def test_a_stem_slips_by_the_op_of_either_scan() -> None:
    runs, model, _ = thinned()
    found = scanned_twice(model, runs)
    assert found is not None
    runs = dataclasses.replace(runs, op=found.op, scans=found.each(runs.op))
    assert runs.scans is not None
    assert runs.scans.reshape(-1, 2).mean(axis=1) == pytest.approx(found.op[:, 0])
    friction = HeStiction(1.0, 0.6)
    moved = friction.simulate(runs.scans[:, 0]).reshape(-1, 2).mean(axis=1)
    held = friction.simulate(runs.op[:, 0])
    assert np.abs(moved - held).max() > 0.2
    sticky = FreeRun(model.with_effect("valve:V1", friction), runs)
    assert sticky.stems[:, 0] == pytest.approx(moved)
    bare = FreeRun(model, runs)
    assert bare.stems == pytest.approx(found.op)
    candidate = next(c for c in valve_candidates(bare) if c.law == "he")
    assert isinstance(candidate, ValveCandidate)
    assert candidate.stems(bare, np.array([[1.0, 0.6, 0.0]])) == pytest.approx(sticky.stems)


def test_without_set_points_the_op_between_two_samples_is_told_too() -> None:
    runs, model, mean = thinned(with_sp=False)
    check = check_controller(model, runs)
    assert check.scans is not None
    away, naive = check.scans.op[:-1, 0] - mean[:-1], runs.op[:-1, 0] - mean[:-1]
    assert np.std(away) < 0.2 * np.std(naive)
    assert check.unsure is not None


def test_its_recorded_tuning_is_no_other_one() -> None:
    runs, model, _ = thinned()
    check = check_controller(model, runs)
    assert check.finding is None
    assert check.scans is not None


def test_a_controller_that_scans_once_holds_its_op() -> None:
    model = loop()
    runs, _ = open_gate(model, [record(model)])
    assert check_controller(model, runs).scans is None


def test_a_sample_that_was_drawn_in_makes_no_second_scan() -> None:
    document = without_controller(loop()).to_mapping()
    document["controller"] = {"kind": "pi", "gain": 0.8, "integral_time": 24.0}
    model = LoopModel.from_mapping(document)
    whole = record(model, samples=700)
    pv, marks = whole.pv.copy(), whole.quality.copy()
    pv[300] = 0.5 * (pv[299] + pv[301])
    marks[300] = Quality.HELD
    runs, _ = open_gate(model, [dataclasses.replace(whole, pv=pv, mask=marks)])
    check = check_controller(model, runs)
    assert (check.status, check.scans, check.clock_known) == (ControllerStatus.SAME, None, True)
