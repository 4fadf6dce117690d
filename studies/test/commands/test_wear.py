from __future__ import annotations

import json
from pathlib import Path

import pytest

from stiction_ros.cli.main import main


@pytest.mark.trial
def test_the_curve_is_written(tmp_path: Path) -> None:
    target = tmp_path / "curve.json"
    call = ["study-wear", "tank", "--seeds", "41:41", "--jobs", "1", "--no-printed"]
    code = main([*call, "--worths", "2", "--json", str(target)])
    found = {row["controller"]: row for row in json.loads(target.read_text())}
    assert list(found) == ["no friction", "SU", "SE exact", "SE exact, worth × 2"]
    assert found["no friction"]["iae_ratio"] == [1.0, 1.0]
    exact, unaware = found["SE exact"], found["SU"]
    spared = exact["travel"] <= unaware["travel"] and exact["moves"] <= unaware["moves"]
    assert code == (0 if spared and max(exact["iae_ratio"]) <= 1.1 else 1)


@pytest.mark.parametrize("worths", ["", "1,x", "0", "-1", "nan"])
def test_worths_that_are_no_numbers_are_refused(
    worths: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study-wear", "tank", "--worths", worths]) == 2
    assert "--worths" in capsys.readouterr().err
