"""`stiction demo tank --compare`: files, JSON, and options that do not fit."""

import json
from pathlib import Path
from typing import Any

import pytest

from stiction_ros.cli.main import main
from stiction_studies.examples.control_study import COLUMNS

SHORT = ["--plant", "linear", "--hold", "40", "--seeds", "5", "--jobs", "1"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out: Path = tmp_path_factory.mktemp("compare")
    copy = str(out / "copy.json")
    assert main(["demo", "tank", "--compare", *SHORT, "--out", str(out), "--json", copy]) == 0
    return out


@pytest.mark.trial
def test_page_figures_and_scores_are_written(folder: Path) -> None:
    names = {path.name for path in (folder / "tank_compare").iterdir()}
    assert names == {"compare.html", "compare.json", "figure6_linear.png", "figure6_linear.svg"}


@pytest.mark.trial
@pytest.mark.parametrize(("width", "tables"), [(80, 2), (120, 1)])
def test_a_terminal_of_80_columns_cuts_nothing_off(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    width: int,
    tables: int,
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    assert main(["demo", "tank", "--compare", *SHORT, "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "…" not in out
    assert out.count("no friction") == tables


@pytest.mark.trial
def test_the_scores_hold_every_controller(folder: Path) -> None:
    document: dict[str, Any] = json.loads((folder / "copy.json").read_text(encoding="utf-8"))
    linear = document["linear"]
    assert linear["seeds"] == [5]
    assert list(linear["columns"]) == [column.key for column in COLUMNS]
    for column in linear["columns"].values():
        assert len(column["by_seed"]) == 1
        assert column["mean"]["outputs"]["C"]["iae"] > 0.0
        assert column["mean"]["p99_ms"] >= column["mean"]["median_ms"] > 0.0


@pytest.mark.trial
def test_the_file_in_the_folder_is_the_same(folder: Path) -> None:
    inside = (folder / "tank_compare" / "compare.json").read_text(encoding="utf-8")
    assert inside == (folder / "copy.json").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (["siso", "--compare"], "--compare"),
        (["tank", "--compare", "--seed", "3"], "--seed"),
        (["tank", "--compare", "--speed", "5"], "--speed"),
        (["tank", "--compare", "--schedule", "scenario", "--hold", "90"], "--hold"),
        (["tank", "--compare", "--hold", "10"], "hold"),
        (["tank", "--seeds", "1:2"], "--seeds"),
        (["tank", "--warm-start", "search"], "--warm-start"),
    ],
)
def test_options_that_do_not_fit_are_one_line_and_exit_2(
    arguments: list[str], where: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["demo", *arguments, "--out", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"stiction: {where}: ")
    assert told.count("\n") == 1
