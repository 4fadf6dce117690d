"""`stiction valve-test`: planned from a record, followed on a simulated loop, judged."""

import json
from pathlib import Path

import pytest

from stiction_ros.cli.main import main

LOOP = ["simulate", "flow.loop.yaml"]
ROUTINE = [*LOOP, "--samples", "600", "--out", "before.csv"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.trial
def test_the_procedure_leads_to_the_verdict(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(ROUTINE) == 0
    planned = ["valve-test", "plan", "before.csv", "--json", "plan.json", "--out", "moves.csv"]
    assert main(planned) == 0
    said = capsys.readouterr().out
    assert "Put the loop in manual at OP" in said
    plan = json.loads((folder / "plan.json").read_text())
    assert plan["return_op"] == plan["moves"][-1]["op"]
    for _ in range(3):
        assert main([*LOOP, "--moves", "moves.csv", "--out", "test.csv"]) == 0
        judged = ["valve-test", "judge", "test.csv", "--before", "before.csv", "--out", "moves.csv"]
        assert main([*judged, "--json", "-"]) == 0
        told = json.loads(capsys.readouterr().out)
        if told["next"] is None:
            break
    assert told["verdict"] == "sticky"
    assert told["f_s_interval"][0] <= 4.0 <= told["f_s_interval"][1]
    assert told["responded"]


def test_a_loop_in_automatic_is_no_test(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(ROUTINE) == 0
    assert main(["valve-test", "judge", "before.csv"]) == 2
    assert "is no test in manual" in capsys.readouterr().err


@pytest.mark.parametrize("limit", ["--op-limit", "--pv-limit"])
def test_a_limit_is_above_zero(
    limit: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["valve-test", "plan", "before.csv", limit, "-1"]) == 2
    assert f"{limit}: -1 is no distance" in capsys.readouterr().err


def test_moves_are_a_table(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "moves.csv").write_text("t,OP\n0,50\n")
    assert main([*LOOP, "--moves", "moves.csv"]) == 2
    assert "moves.csv: cannot be read" in capsys.readouterr().err
