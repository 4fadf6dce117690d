"""`stiction bench plant`: the list of a survey against the truth of a made plant."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from stiction_ros.cli.main import main
from stiction_studies.benches.accuracy.plant import Listed, listed, shares


def truth(name: str, slips: int = 20, valve: str = "sticky") -> dict[str, Any]:
    causes = ["valve"] if valve != "healthy" else ["none"]
    return {"name": name, "valve": valve, "slips_in_automatic": slips, "causes": causes}


def said(name: str, verdict: str = "sticky", cause: str | None = "valve") -> dict[str, Any]:
    return {"name": name, "status": "ok", "verdict": verdict, "cause": cause}


def test_a_loop_keeps_its_place_and_its_truth() -> None:
    plant = {"loops": [truth("A"), truth("B", 3), truth("C", valve="healthy"), truth("D")]}
    failed = {"name": "D", "status": "failed", "verdict": None, "cause": None}
    survey = {"loops": [said("C", cause="unknown"), said("A"), said("B", "undecided"), failed]}
    rows = listed(plant, survey)
    assert [(row.name, row.place, row.sticky, row.cause_right) for row in rows] == [
        ("C", 1, False, None),
        ("A", 2, True, True),
        ("B", 3, False, True),
        ("D", None, True, None),
    ]


def test_a_loop_that_the_list_does_not_have_is_lost() -> None:
    (row,) = listed({"loops": [truth("A")]}, {"loops": []})
    assert (row.status, row.place, row.verdict) == ("lost", None, None)
    assert shares([row])[0].count == 0


def test_shares_count_from_the_top_of_the_list() -> None:
    rows = [Listed(f"F{k}", k + 1, k % 2 == 0, "sticky", True, "ok") for k in range(100)]
    counted = {share.name: (share.count, share.total) for share in shares(rows)}
    assert counted["in order, of the first 30"] == (15, 30)
    assert counted["sticky, in 60 places"] == (30, 50)
    assert counted["sticky, of the found"] == (50, 100)
    assert counted["cause right"] == (100, 100)


def test_it_reads_both_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plant, survey, out = (tmp_path / name for name in ("truth.json", "now.json", "out.json"))
    plant.write_text(json.dumps({"loops": [truth("A")]}))
    survey.write_text(json.dumps({"loops": [said("A")]}))
    files = ["--truth", str(plant), "--survey", str(survey)]
    assert main(["bench", "plant", *files, "--json", str(out)]) == 0
    document = json.loads(out.read_text())
    assert document["loops"][0]["name"] == "A"
    assert main(["bench", "plant", *files]) == 0
    assert "sticky, in 1 places" in capsys.readouterr().out


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.unlink(),
        lambda path: path.write_text("no JSON"),
        lambda path: path.write_text("[]"),
        lambda path: path.write_text('{"rates": []}'),
    ],
)
def test_a_file_that_is_something_else_is_refused(
    spoil: Callable[[Path], Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plant = tmp_path / "truth.json"
    plant.write_text(json.dumps({"loops": []}))
    spoil(plant)
    assert main(["bench", "plant", "--truth", str(plant), "--survey", str(plant)]) == 2
    assert str(plant) in capsys.readouterr().err


def test_both_files_are_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "plant"]) == 2
    assert "--truth" in capsys.readouterr().err
