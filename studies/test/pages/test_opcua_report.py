"""Who had the valves, and how OP went over from one to the other."""

import json
import math
from pathlib import Path

import pytest

from stiction_ros.report.run.scoring import Phase, Phases, PhaseStatus, Score
from stiction_studies.pages.opcua_report import (
    GrantChange,
    Transfer,
    _failure,
    journal_steps,
    transfers_of,
)

ASKED = GrantChange(2.0, "asked", "waits")
GRANTED = GrantChange(5.0, "granted", "granted by the mode")
BACK = GrantChange(8.0, "idle", "taken back by the mode")


def test_transfers_are_told_with_the_step_that_the_plant_has_noted() -> None:
    found = transfers_of([ASKED, GRANTED, BACK], [0.4, 0.3])
    told = [(one.time, one.to, one.step) for one in found]
    assert told == [(5.0, "remote", 0.4), (8.0, "plant", 0.3)]


def test_steps_of_other_transfers_are_not_taken() -> None:
    (found,) = transfers_of([ASKED, GRANTED], [0.4, 0.3])
    assert math.isnan(found.step)


def test_a_reason_that_changes_is_no_transfer() -> None:
    waits = GrantChange(1.0, "idle", "waits: no sample yet")
    assert transfers_of([waits, ASKED], []) == []


def test_the_plants_journal_tells_the_step_to_the_write(tmp_path: Path) -> None:
    events = [
        {"event": "mode", "mode": "AUTO", "sample": 0},
        {"event": "out", "out": [50.0], "sample": 4},
        {"event": "out", "out": [52.0], "sample": 5},
        {"event": "mode", "mode": "ROUT", "sample": 5},
        {"event": "out", "out": [52.0], "sample": 5},
        {"event": "op", "op": [52.1], "sample": 6},
        {"event": "op", "op": [60.0], "sample": 7},
        {"event": "mode", "mode": "AUTO", "sample": 7},
        {"event": "out", "out": [60.0], "sample": 7},
        {"event": "out", "out": [60.3], "sample": 8},
        {"event": "out", "out": [64.0], "sample": 9},
    ]
    path = tmp_path / "journal.jsonl"
    path.write_text("".join(json.dumps(event) + "\n" for event in events))
    assert journal_steps(path) == pytest.approx([0.1, 0.3])
    assert journal_steps(tmp_path / "none") == []


def phases_of(before: float, after: float, reason: str = "") -> Phases:
    first, second = (
        Phase(0, 10, {"C": Score(value, 0.0, 0.0)}, {}, {}) for value in (before, after)
    )
    status = PhaseStatus.NO_CYCLE if reason else PhaseStatus.OK
    return Phases(status, reason, None, first, second)


SMOOTH = [Transfer(5.0, "remote", "", 0.2), Transfer(8.0, "plant", "", 0.1)]


@pytest.mark.parametrize(
    ("found", "transfers", "said"),
    [
        (phases_of(1.0, 0.1), SMOOTH, ""),
        (phases_of(1.0, 0.9), SMOOTH, "goes on cycling"),
        (phases_of(1.0, 0.1, "no cycle"), SMOOTH, "no cycle"),
        (phases_of(1.0, 0.1), SMOOTH[:1], "granted and taken back once"),
        (
            phases_of(1.0, 0.1),
            [SMOOTH[0], Transfer(8.0, "plant", "", 3.0)],
            "stepped by 0.20, 3.00 %",
        ),
    ],
)
def test_a_run_is_judged(found: Phases, transfers: list[Transfer], said: str) -> None:
    assert said in _failure(found, transfers)
    assert bool(said) == bool(_failure(found, transfers))
