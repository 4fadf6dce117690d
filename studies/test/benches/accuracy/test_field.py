"""`stiction bench field`: its counting and options."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.records.record import Record
from stiction_studies.benches.accuracy import field as bench_field
from stiction_studies.benches.accuracy.answer import Answer, answer_of
from stiction_studies.benches.accuracy.field import Judged, shares, splits


def said(verdict: str = "sticky", **changes: Any) -> Answer:
    values: dict[str, Any] = {
        "verdict": verdict,
        "f_s": (1.0, 2.0),
        "f_d": (0.5, 1.0),
        "band": (1.5, 3.0),
        "cause": None,
        "seconds": 0.5,
    }
    return Answer(**(values | changes))


def judged(seed: int = 1, answer: Answer | None = None, **changes: Any) -> Judged:
    values: dict[str, Any] = {
        "seed": seed,
        "kind": "flow",
        "plant": "flow",
        "circumstances": (),
        "samples": 900,
        "valve": "sticky",
        "law": "he",
        "band": 2.0,
        "f_s": 1.4,
        "f_d": 0.6,
        "causes": ("valve",),
        "slips": 20,
        "answer": answer or said(),
    }
    return Judged(**(values | changes))


def healthy(seed: int, verdict: str, cause: str | None = None) -> Judged:
    return judged(
        seed, said(verdict, cause=cause), valve="healthy", causes=("disturbance",), slips=0
    )


def counts(rows: list[Judged]) -> dict[str, tuple[int, int]]:
    return {rate.name: (rate.count, rate.total) for rate in shares(rows)}


def test_what_the_true_stem_shows_is_counted_where_it_was_asked() -> None:
    rows = [
        judged(1, said("sticky"), shown=30.0),
        judged(2, said("undecided"), shown=1.0),
        judged(3, said("backlash"), shown=-4.0),
        judged(4, said("sticky")),
        judged(5, said("sticky"), slips=3, shown=9.0),
        dataclasses.replace(healthy(6, "undecided"), shown=2.0),
        dataclasses.replace(healthy(7, "healthy"), shown=-2.0),
    ]
    told = counts(rows)
    assert told["true stem shows its friction"] == (2, 3)
    assert told["friction found, of these"] == (1, 2)
    assert told["friction put into others shows"] == (1, 2)
    assert "true stem shows its friction" not in counts(rows[3:4])


def test_rates_count_what_they_say() -> None:
    rows = [
        judged(1, said("sticky", cause="valve")),
        judged(2, said("backlash", cause="tuning")),
        judged(3, said("healthy", cause="unknown")),
        judged(4, said("undecided")),
        judged(5, said("healthy"), slips=3),
        judged(6, said("undecided"), slips=5),
        healthy(7, "healthy", "disturbance"),
        healthy(8, "sticky"),
        healthy(9, "refused"),
    ]
    found = counts(rows)
    assert found["friction found"] == (2, 4)
    assert found["friction called healthy"] == (1, 4)
    assert found["others called sticky or backlash"] == (1, 3)
    assert found["undecided of both"] == (2, 7)
    assert found["fewer slips: right or undecided"] == (1, 2)
    assert found["cause right"] == (2, 4)
    assert found["cause wrong"] == (1, 4)


def test_intervals_are_held_against_the_truth_where_friction_was_found() -> None:
    rows = [
        judged(1),
        judged(2, said(f_s=(1.5, 2.0))),
        judged(3, said("undecided", band=(9.0, 9.5))),
        judged(4, f_s=None, f_d=None, band=4.0),
    ]
    found = counts(rows)
    assert found["interval of the band holds the truth"] == (2, 3)
    assert found["He's law: interval of f_S"] == (1, 2)
    assert found["He's law: interval of f_D"] == (2, 2)


def test_every_loop_stands_in_its_rows() -> None:
    rows = [judged(1, circumstances=("fast", "no_set_point")), healthy(2, "healthy")]
    parts = splits(rows)
    assert [row.seed for row in parts["with fast"]] == [1]
    assert [row.seed for row in parts["with nothing unusual"]] == [2]
    assert [row.seed for row in parts["plant flow"]] == [1, 2]
    assert sum(len(parts[group]) for group in bench_field.GROUPS) == 2


def test_a_record_that_is_refused_is_an_answer() -> None:
    record = Record("r", 1.0, ("V",), ("P",), np.zeros((5, 1)), np.zeros((5, 1)))

    def refuse(record: Record) -> dict[str, Any]:
        raise InputError("too short", where=record.name)

    answer = answer_of(record, refuse)
    assert (answer.verdict, answer.reason) == ("refused", "r: too short")


def test_field_writes_rates_rows_and_loops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fake(work: Any, seeds: tuple[int, int], jobs: int, text: str) -> list[Judged]:
        return [judged(seed) for seed in range(seeds[0], seeds[1] + 1)]

    monkeypatch.setattr(bench_field, "run_seeds", fake)
    out = tmp_path / "field.json"
    assert main(["bench", "field", "--seeds", "3:5", "--json", str(out)]) == 0
    assert "friction found" in capsys.readouterr().out
    document = json.loads(out.read_text())
    assert document["name"] == "field"
    assert {"case", "subject", "baseline", "subject_ms", "ratio", "note"} <= set(
        document["rows"][0]
    )
    assert [loop["seed"] for loop in document["loops"]] == [3, 4, 5]
