"""Who had the valves, and how OP went over from one to the other."""

from __future__ import annotations

import types
from typing import Any

import numpy as np
import pytest

from stiction_ros.report.opcua_report import BridgedRun, GrantChange, Transfer, _failure
from stiction_ros.report.scoring import Phase, Phases, PhaseStatus, Score

SECOND = 1_000_000_000
ASKED = GrantChange(2 * SECOND, "asked", "waits")
GRANTED = GrantChange(5 * SECOND, "granted", "granted by the mode")
BACK = GrantChange(8 * SECOND, "idle", "taken back by the mode")


def run(*grants: GrantChange, applied: Any = None) -> BridgedRun:
    log: Any = types.SimpleNamespace(seconds=lambda stamp: stamp / SECOND)
    values = np.full((12, 1), 50.0) if applied is None else applied
    return BridgedRun(log, grants, SECOND * np.arange(12), values, ("V1",))


def test_transfers_are_told_with_their_step() -> None:
    applied = np.full((12, 1), 50.0)
    applied[5:] = 50.4
    applied[7:] = 60.0  # the controller's own move, before it is taken back
    applied[9:] = 60.3
    found = run(ASKED, GRANTED, BACK, applied=applied).transfers()
    assert [(one.time, one.to) for one in found] == [(5.0, "remote"), (8.0, "plant")]
    assert found[0].step == pytest.approx(0.4)
    assert found[1].step == pytest.approx(0.3)


def test_a_reason_that_changes_is_no_transfer() -> None:
    waits = GrantChange(SECOND, "idle", "waits: no sample yet")
    assert run(waits, ASKED).transfers() == []


def phases_of(before: float, after: float, reason: str = "") -> Phases:
    first, second = (Phase(0, 10, {"C": Score(value, 0.0, 0.0)}) for value in (before, after))
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
        (phases_of(1.0, 0.1), [SMOOTH[0], Transfer(8.0, "plant", "", 3.0)], "stepped by 3.00 %"),
    ],
)
def test_a_run_is_judged(found: Phases, transfers: list[Transfer], said: str) -> None:
    assert said in _failure(found, transfers)
    assert bool(said) == bool(_failure(found, transfers))
