"""`stiction gap` from files to exit codes."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "discrepancy"))

from gap_loops import loop, record, with_cause

from stiction_ros.cli.main import main
from stiction_ros.effects import ProcessGain, StepDisturbance
from stiction_ros.loop import LoopModel
from stiction_ros.loop.plant import Plant
from stiction_ros.records.csv_writer import write_csv


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gap")
    loop().save(folder / "model.loop.yaml")
    write_csv(with_cause("process:PV1", ProcessGain(1.4))[1], folder / "gain.csv")
    write_csv(with_cause("disturbance:PV1", StepDisturbance(500.0, 2.0))[1], folder / "step.csv")
    write_csv(record(loop(), seed=2), folder / "healthy.csv")
    return folder


def ran(files: Path, name: str, *more: str) -> int:
    return main(["gap", str(files / "model.loop.yaml"), str(files / name), "--quick", *more])


@pytest.mark.trial
def test_a_named_effect_is_written_with_its_model(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ran(files, "gain.csv", "--json", "-", "--out", str(tmp_path)) == 0
    document = json.loads(capsys.readouterr().out)
    assert [effect["effect"] for effect in document["effects"]] == ["gain"]
    assert set(document["gap"]["before"]["PV1"]) == {
        "free_run_rmse",
        "one_step_rmse",
        "noise_floor",
    }
    Plant(LoopModel.load(tmp_path / "model_after.loop.yaml"), 0)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "The simulation lacks other gain in the process to PV1" in page


@pytest.mark.trial
def test_an_ambiguous_effect_has_a_code_of_its_own(files: Path) -> None:
    assert ran(files, "step.csv") == 3


def test_nothing_missing_is_no_failure(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(files, "healthy.csv") == 0
    assert "none" in capsys.readouterr().out


def test_a_model_without_a_record_is_refused(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["gap", str(files / "model.loop.yaml")]) == 2
    assert "no record" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("inputs", "said"),
    [
        (["healthy.csv", "model.loop.yaml"], "healthy.csv: is no loop model; name the model first"),
        (["--fit-linear", "model.loop.yaml", "healthy.csv"], "is a loop model; leave it out"),
    ],
)
def test_a_model_in_the_place_of_a_record_is_told(
    files: Path, capsys: pytest.CaptureFixture[str], inputs: list[str], said: str
) -> None:
    paths = [str(files / each) if "." in each else each for each in inputs]
    assert main(["gap", *paths]) == 2
    assert said in capsys.readouterr().err


def test_the_record_of_the_experiment_is_read_with_the_others(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [str(files / "model.loop.yaml"), str(files / "healthy.csv")]
    assert main(["gap", *given, "--after", "after.csv"]) == 2
    assert "after.csv: no such file" in capsys.readouterr().err


@pytest.mark.trial
def test_a_model_that_comes_along_is_found_by_its_name(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["gap", "flow.loop.yaml", str(files / "healthy.csv"), "--quick"]) in (0, 3, 4)
    assert "no such file" not in capsys.readouterr().err
