import dataclasses
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.intake.loop import Loop
from stiction_ros.loop import LoopModel
from stiction_ros.loop.closed_loop import PiController, simulate_closed_loop
from stiction_ros.loop.set_points import SetPoints
from stiction_ros.records.record import Quality, Record
from stiction_ros.survey import assess as module
from stiction_ros.survey.assess import Assessed, assess, at_limits
from stiction_ros.survey.entry import Status, SurveyOptions

MODEL = {
    "loop": "FIC1",
    "sample_time": 2.0,
    "valves": [
        {"name": "V1", "effects": [{"effect": "stiction", "law": "he", "f_s": 4.0, "f_d": 1.5}]}
    ],
    "process": {
        "kind": "arx",
        "outputs": [
            {
                "name": "PV1",
                "a": [-0.8],
                "b": {"V1": [0.2]},
                "delay": {"V1": 2},
                "noise": {"std": 0.05, "enters": "measurement"},
            }
        ],
    },
    "operating_point": {"op": {"V1": 50.0}, "pv": {"PV1": 50.0}},
    "controller": {"kind": "pi", "gain": 0.5, "integral_time": 10.0},
}


@pytest.fixture(scope="module")
def record() -> Record:
    model = LoopModel.from_mapping(MODEL)
    assert model.controller is not None
    control = PiController(model.controller, 2.0, 50.0, (0.0, 100.0))
    moves = SetPoints(("PV1",), np.array([0.0, 20.0]), np.array([[50.0], [53.0]]))
    return simulate_closed_loop(model, control, moves, 900, 3).record


def _loop(*parts: Record) -> Loop:
    return Loop("FIC1", (Path("FIC1.csv"),), parts, ("2 values were held",))


@pytest.fixture(scope="module")
def assessed(record: Record) -> Assessed:
    return assess(_loop(record), SurveyOptions(gain=False))


@pytest.mark.trial
def test_a_valve_that_sticks_is_found(assessed: Assessed) -> None:
    entry = assessed.entry
    assert entry.status is Status.OK
    assert entry.verdict == "sticky"
    assert entry.f_s == pytest.approx(4.0, abs=0.3)
    assert entry.samples == 900
    assert entry.sample_time == 2.0
    assert entry.auto_share == 1.0
    assert entry.travel_per_hour is not None
    assert entry.travel_per_hour > 0.0
    assert "2 values were held" in entry.notes
    assert "FIC1: The valve sticks" in assessed.page
    assert any("verdict: sticky, cycles by: " in line for line in assessed.log)


def test_signals_of_a_file_of_one_loop_bear_its_name(record: Record, assessed: Assessed) -> None:
    assert record.valves == ("V1",)
    assert "the stem of FIC1 rests" in assessed.page
    assert "V1" not in assessed.page


def test_a_loop_in_manual_is_skipped(record: Record) -> None:
    by_hand = dataclasses.replace(record, mask=np.full(len(record), Quality.MANUAL, np.uint8))
    entry = assess(_loop(by_hand), SurveyOptions()).entry
    assert entry.status is Status.SKIPPED
    assert entry.auto_share == 0.0
    assert "manual" in entry.reason


def test_a_short_record_and_one_that_does_not_move_are_skipped(record: Record) -> None:
    for part, word in (
        (record.part(0, 60), "60 of 100 samples"),
        (dataclasses.replace(record, op=np.full((900, 1), 40.0), stem=None), "is constant"),
    ):
        entry = assess(_loop(part), SurveyOptions()).entry
        assert entry.status is Status.SKIPPED
        assert word in entry.reason


def test_whatever_goes_wrong_is_said_of_this_loop(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr(module, "identify", broken)
    found = assess(_loop(record), SurveyOptions())
    assert found.entry.status is Status.FAILED
    assert "ZeroDivisionError: by chance" in found.entry.reason
    assert found.entry.samples == 900


def test_a_loop_without_samples_fails_with_its_reason() -> None:
    entry = assess(Loop("X", (), (), problem="has no column OP"), SurveyOptions()).entry
    assert (entry.status, entry.reason) == (Status.FAILED, "has no column OP")


def test_rests_at_a_limit_are_counted() -> None:
    op = np.concatenate([np.linspace(0.0, 100.0, 90), np.full(10, 100.0)])
    assert at_limits(op, (-np.inf, 100.0)) == pytest.approx(0.11)
    assert at_limits(op, (-np.inf, np.inf)) == 0.0
