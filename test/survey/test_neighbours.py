import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from stiction_ros.identification import VerdictKind
from stiction_ros.records import Record
from stiction_ros.survey import neighbours as module
from stiction_ros.survey.assess import Assessed
from stiction_ros.survey.entry import Cycling, Entry, Status
from stiction_ros.survey.neighbours import neighbours

BEATS = np.arange(0.0, 2000.0, 100.0)


def entry(name: str, verdict: str, cause: str, beats: np.ndarray = BEATS) -> Entry:
    swing = Cycling(100.0, 3.0, 1.0)
    evidence = {"loop_gone": 0.9 if verdict == "sticky" else 0.0}
    return Entry(
        name,
        (),
        Status.OK,
        verdict=verdict,
        cause=cause,
        oscillation=swing,
        probability=0.9 if verdict == "sticky" else 0.1,
        evidence=evidence,
        beats=tuple(beats),
    )


def judged(monkeypatch: pytest.MonkeyPatch, *entries: Entry) -> module.Neighbours:
    """Judge loops of which the survey says what ``entries`` hold."""
    told = {one.name: one for one in entries}
    monkeypatch.setattr(module, "assess", lambda loop, _options: Assessed(told[loop.name]))
    still = np.zeros((2, 1))
    records = {name: Record(name, 1.0, (f"V{name}",), (f"P{name}",), still, still) for name in told}
    return neighbours(records)


def test_one_valve_and_whom_it_disturbs(monkeypatch: pytest.MonkeyPatch) -> None:
    found = judged(
        monkeypatch,
        entry("B", "undecided", "disturbance", BEATS + 30.0),
        entry("A", "sticky", "valve"),
        entry("C", "healthy", "unknown", BEATS - 20.0),
    )
    assert found.sources == {"A": "VA"}
    assert [(one.name, one.by) for one in found.disturbed] == [("C", "A"), ("B", "A")]
    assert [one.behind for one in found.disturbed] == pytest.approx([-20.0, 30.0])
    assert found.sentences[0] == "Service VA and 3 loops stop cycling."
    assert "C: disturbed by A; it keeps the period of 100 s" in found.sentences[2]
    assert "begin 20 s before those of A" in found.sentences[2]
    assert found.to_dict()["sources"] == {"A": "VA"}


def test_a_loop_of_another_period_is_not_disturbed(monkeypatch: pytest.MonkeyPatch) -> None:
    other = dataclasses.replace(
        entry("B", "healthy", "tuning", np.arange(0.0, 2000.0, 70.0)),
        oscillation=Cycling(70.0, 3.0, 1.0),
    )
    found = judged(monkeypatch, entry("A", "sticky", "valve"), other)
    assert found.disturbed == ()
    assert found.sentences[0] == "Service VA and A stops cycling."


def test_a_valve_that_sticks_only_where_its_loop_is_judged_alone_is_disturbed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def explained(record: Record) -> SimpleNamespace:
        names = VerdictKind.STICKY, VerdictKind.HEALTHY
        kinds = [names[valve != "VA"] for valve in record.valves]
        valves = [SimpleNamespace(verdict=k, probability=0.1, evidence={}) for k in kinds]
        return SimpleNamespace(valves=valves)

    monkeypatch.setattr(module, "identify", explained)
    found = judged(monkeypatch, entry("B", "sticky", "valve"), entry("A", "sticky", "valve"))
    assert found.sources == {"A": "VA"}
    assert found.entries["B"].verdict == "healthy"
    assert "by its own signals its valve seems sticky" in found.sentences[2]


def test_no_valve_is_named_where_none_makes_the_cycle(monkeypatch: pytest.MonkeyPatch) -> None:
    loops = entry("A", "healthy", "tuning"), entry("B", "undecided", "disturbance")
    found = judged(monkeypatch, *loops)
    assert found.sources == {}
    assert found.sentences == ["No valve is shown to make these loops cycle."]
