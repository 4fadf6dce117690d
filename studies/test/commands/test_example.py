"""`stiction example`: one seed, many seeds, what it writes and what it refuses."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stiction_ros import read
from stiction_ros.cli.main import main
from stiction_studies.examples import example1


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("example")
    assert main(["example", "1", "--seed", "2", "--out", str(directory)]) == 0
    return directory


def result(directory: Path) -> dict[str, Any]:
    return dict(json.loads((directory / "result.json").read_text(encoding="utf-8")))


@pytest.mark.trial
def test_three_files_are_written(written: Path) -> None:
    names = {path.name for path in written.iterdir()}
    assert names == {"record.csv", "result.json", "report.html"}


@pytest.mark.trial
def test_the_record_is_the_example(written: Path) -> None:
    record, made = read(written / "record.csv"), example1(2).record
    assert np.array_equal(record.op, made.op)
    assert np.array_equal(record.pv, made.pv)


@pytest.mark.trial
def test_the_result_compares_with_the_truth(written: Path) -> None:
    found = result(written)
    assert (found["example"], found["variant"], found["seed"]) == ("example1", "measurement", 2)
    (valve,), (channel,) = found["valves"], found["channels"]
    assert valve["f_s"]["true"] == 5.0
    assert valve["f_s"]["found"] == pytest.approx(5.0, abs=0.1)
    assert valve["f_d"]["found"] == pytest.approx(2.0, abs=0.1)
    assert channel["delay"]["true"] == 5
    assert {"stem_error", "square_error", "true_stem_square_error"} <= found.keys()
    assert found["identification"]["samples"] == 2500


@pytest.mark.trial
def test_the_report_shows_the_figures(written: Path) -> None:
    page = (written / "report.html").read_text(encoding="utf-8")
    assert '<figure id="window">' in page
    assert page.count("data:image/png;base64") == 1
    assert page.count("<svg") > 4


@pytest.mark.trial
def test_many_seeds_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["example", "healthy", "--family", "sine", "--seeds", "3:4", "--jobs", "1"]
    assert main([*arguments, "--na", "1", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["example"], found["variant"]) == ("healthy", "sine")
    assert [run["seed"] for run in found["runs"]] == [3, 4]
    assert [len(run["identification"]["outputs"][0]["a"]) for run in found["runs"]] == [1, 1]
    assert sum(finding["count"] for finding in found["findings"]) == 2
    assert all(finding["total"] == 2 for finding in found["findings"])


@pytest.mark.trial
def test_one_seed_prints_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["example", "healthy", "--seed", "3", "--na", "1", "--nb", "1"]) == 0
    said = capsys.readouterr().out
    assert "healthy, tight, seed 3" in said
    assert "f_S %" in said
    assert "stem error" in said


def test_the_paper_s_settings_can_be_given(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["example", "2", "--samples", "620", "--seed", "1", "--method", "grid"]
    arguments += ["--na", "2", "--grid-step", "4", "--friction-limit", "8.5,4.5", "--json", "-"]
    assert main(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["identification"]["model"]["search"]["points"] == 6 * 3
    first, second = (valve["f_s"]["found"] for valve in found["valves"])
    assert first in (0.0, 4.0, 8.0)
    assert second in (0.0, 4.0)


@pytest.mark.parametrize(
    "arguments",
    [
        ["1", "--method", "grid", "--starts", "2"],
        ["1", "--plant", "tank"],
        ["example2", "--noise", "equation"],
        ["2", "--family", "sine"],
        ["1", "--seed", "-1"],
        pytest.param(["1", "--nb", "2"], marks=pytest.mark.trial),
        ["healthy", "--seeds", "1:2", "--out", "somewhere"],
        ["healthy", "--samples", "500"],
        ["1", "--samples", "40"],
        ["1", "--samples", "0"],
        ["2", "--samples", "-5"],
    ],
)
def test_what_does_not_fit_is_one_line_and_exit_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["example", *arguments]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1


@pytest.mark.parametrize("arguments", [["3"], ["1", "--seeds", "5:2"], ["1", "--noise", "none"]])
def test_what_is_unknown_is_refused_by_the_parser(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["example", *arguments])
    assert end.value.code == 2
