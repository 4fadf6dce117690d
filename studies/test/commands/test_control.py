import json
from pathlib import Path

import pytest

from stiction_ros.cli.main import main
from stiction_studies.commands.control import CaseScores


@pytest.mark.trial
def test_a_case_is_scored_and_written(tmp_path: Path) -> None:
    target = tmp_path / "scores.json"
    call = ["study-control", "--seeds", "41:41", "--jobs", "1", "--cases", "nominal"]
    code = main([*call, "--json", str(target)])
    (found,) = json.loads(target.read_text())
    assert code == (0 if found["met"] else 1)
    assert found["case"] == "nominal"
    assert max(found["iae_ratio"]) < 1.3
    assert max(found["cycle"]) < 0.3


def test_an_unknown_case_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study-control", "--cases", "none"]) == 2
    assert "nominal" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "met"),
    [
        ({}, True),
        ({"iae_ratio": (1.2, 1.0)}, False),
        ({"iae_ratio": (1.2, 1.0), "iae_limit": None}, True),
        ({"offset": (0.007, 0.0)}, False),
        ({"cycle": (0.0, 0.2)}, False),
    ],
)
def test_a_case_is_met_when_everything_holds(changes: dict[str, object], met: bool) -> None:
    values: dict[str, object] = {
        "case": "nominal",
        "iae_ratio": (1.0, 1.1),
        "iae_limit": 1.15,
        "offset": (0.005, 0.01),
        "cycle": (0.1, 0.1),
        "late_turns": 1,
        "reversals": 8.0,
        "travel_ratio": 0.9,
        "moves_ratio": 0.9,
        "op_step": 20.0,
        "moves": 10.0,
        "travel": 100.0,
    }
    assert CaseScores(**{**values, **changes}).met is met  # type: ignore[arg-type]
