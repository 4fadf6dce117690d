"""What is said of a window that was looked into."""

import dataclasses
import json
import pickle
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from monitored_loops import ONSET, loop, record, shifted, sticky

from stiction_ros.discrepancy import GapVerdict
from stiction_ros.online.monitor.gap_finding import GapFinding, find_in_window, standing
from stiction_ros.texts import json_text


@pytest.fixture(scope="module")
def shift() -> GapFinding:
    return find_in_window(loop(), record(shifted(), 1400).part(800, 1400))


@pytest.fixture(scope="module")
def friction() -> GapFinding:
    return find_in_window(loop(), record(sticky(), 900).part(200, 900))


def test_the_window_is_counted_in_samples_of_the_run(shift: GapFinding) -> None:
    assert (shift.begin, shift.end) == (800, 1399)


def test_times_are_those_of_the_run_in_words_and_of_the_window_in_the_document(
    shift: GapFinding,
) -> None:
    moment = shift.document["effects"][0]["parameters"]["time"]
    assert moment == pytest.approx(ONSET - 800, abs=5.0)
    assert f"time {moment + 800:.4g}" in shift.text


def test_a_shift_is_left_open_between_sensor_and_load(shift: GapFinding) -> None:
    assert shift.verdict is GapVerdict.AMBIGUOUS
    assert "bias step of the sensor of PV1" in shift.text
    assert "step of a disturbance on PV1" in shift.text
    assert " or " in shift.text


def test_friction_is_named_with_value_interval_and_unit(friction: GapFinding) -> None:
    assert friction.verdict is GapVerdict.NAMED
    assert friction.text.startswith("stiction of valve V1: f_s ")
    assert " to " in friction.text
    assert ") %" in friction.text


@pytest.mark.trial
def test_the_same_window_gives_the_same_document(friction: GapFinding) -> None:
    again = find_in_window(loop(), record(sticky(), 900).part(200, 900))
    assert json_text(again.to_dict()) == json_text(friction.to_dict())


def test_a_finding_goes_through_processes_and_json(friction: GapFinding) -> None:
    assert pickle.loads(pickle.dumps(friction)).to_dict() == friction.to_dict()
    assert json.loads(json_text(friction.to_dict()))["verdict"] == "named"


def test_a_healthy_window_names_nothing() -> None:
    found = find_in_window(loop(), record(loop(), 900).part(200, 900))
    assert found.verdict is GapVerdict.NONE
    assert found.effects == ()
    assert found.text == "no effect of the catalogue is found"


def test_a_window_that_failed_is_unusable() -> None:
    found = GapFinding(3, 9, None, "window not usable: too short", (), {})
    assert found.to_dict()["verdict"] == "unusable"


@pytest.mark.parametrize(
    ("verdict", "stays"),
    [
        (None, True),
        (GapVerdict.NONE, True),
        (GapVerdict.UNTESTABLE, True),
        (GapVerdict.UNKNOWN, False),
        (GapVerdict.AMBIGUOUS, False),
        (GapVerdict.NAMED, False),
    ],
)
def test_only_a_window_that_shows_something_takes_a_finding_back(
    friction: GapFinding, verdict: GapVerdict | None, stays: bool
) -> None:
    later = dataclasses.replace(friction, verdict=verdict, text="later")
    assert (standing(friction, later) is friction) is stays
    assert standing(None, later) is later
