import json
from pathlib import Path

import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.survey import survey as surveying
from stiction_ros.survey.engines import dask as dask_engine


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exports")
    flat = "".join(f"{k},40.0,20.0,20.0\n" for k in range(200))
    (folder / "FIC1.csv").write_text("t,OP,PV,SP\n" + flat)
    (folder / "FIC2.csv").write_text("nothing of use\n1\n2\n")
    return folder


def _code(arguments: list[str]) -> int:
    try:
        return main(arguments)
    except SystemExit as ended:
        return int(ended.code or 0)


def test_a_folder_gives_a_list_with_a_reason_for_every_loop(
    exports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    costs = tmp_path / "cost.csv"
    costs.write_text("loop,cost\nFIC1,3.5\nFIC11,2\n")
    arguments = ["survey", str(exports), "--out", str(out), "--jobs", "1", "--cost", str(costs)]
    assert _code([*arguments, "--json", str(tmp_path / "s.json")]) == 0
    document = json.loads((tmp_path / "s.json").read_text())
    rows = {row["name"]: row for row in document["loops"]}
    assert rows["FIC1"]["status"] == "skipped"
    assert "constant" in rows["FIC1"]["reason"]
    assert rows["FIC2"]["status"] == "failed"
    assert rows["FIC2"]["reason"]
    assert document["engine"] == "local"
    for name in ("survey.html", "survey.csv", "survey.xlsx", "survey.log", "loops.jsonl"):
        assert (out / name).stat().st_size > 0
    told = capsys.readouterr()
    assert "FIC1" in told.out
    assert "no loop is called FIC11" in told.err
    before = (out / "loops.jsonl").read_bytes()
    assert _code([*arguments, "--resume"]) == 0
    assert (out / "loops.jsonl").read_bytes() == before


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--engine", "spark://x"], "use local, or dask://"),
        (["--engine", "dask://127.0.0.1:1"], "no scheduler answers"),
        (["--resume"], "add --out DIR"),
        (["--jobs", "0"], "no number of processes"),
        (["--cost", "none.csv"], "no such file"),
        (["--previous", "none.json"], "cannot be read"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(
    exports: Path,
    more: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dask_engine, "PATIENCE", 1.0)
    assert _code(["survey", str(exports), *more]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert len(error.splitlines()) == 1


@pytest.mark.trial
def test_nothing_judged_is_a_failure_and_nothing_written_is_told(
    exports: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _code(["survey", str(exports / "FIC2.csv"), "--jobs", "1"]) == 1
    told = capsys.readouterr()
    assert "1 of 1 could not be judged" in told.out
    assert "no list and no page was written" in told.err


def test_an_interrupt_says_how_to_go_on(
    exports: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(surveying, "survey", interrupted)
    assert _code(["survey", str(exports), "--out", str(tmp_path)]) == 130
    assert "interrupted; --resume goes on" in capsys.readouterr().err


def test_a_path_that_is_not_there_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert _code(["survey", "nowhere"]) == 2
    assert "nowhere: there is no such file or folder" in capsys.readouterr().err


def test_gain_of_a_model_needs_its_controller(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _code(["gain", "config/example1.loop.yaml"]) == 2
    assert "has no controller" in capsys.readouterr().err


def test_gain_of_a_model_in_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "flow.loop.yaml"
    text = Path("config/example1.loop.yaml").read_text()
    model.write_text(text + "controller: {kind: pi, gain: 1.0, integral_time: 40.0}\n")
    assert _code(["gain", str(model), "--samples", "300", "--json", "-"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert set(document["now"]) == {
        "amplitude",
        "iae_per_hour",
        "travel_per_hour",
        "moves_per_hour",
        "reversals_per_hour",
        "period",
    }
    whats = [option["what"] for option in document["options"]]
    assert whats == ["service", "embedding", "retune", "leave"]
    for option in document["options"]:
        assert set(option) >= {*document["now"], "what", "interval", "note"}


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["gain", "config/flow.loop.yaml", "--law", "he"], "a model brings its own"),
        (["gain", "EXPORT", "--law", "hee"], "unknown friction law 'hee'"),
        (["survey", "EXPORT", "--law", "hee"], "unknown friction law 'hee'"),
    ],
)
def test_a_law_that_cannot_be_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str], said: str
) -> None:
    export = tmp_path / "export.csv"
    rows = [f"{k},{50 + k % 7},{40 + k % 5},{42 + k % 3}" for k in range(200)]
    export.write_text("\n".join(["t,OP,PV,SP", *rows]))
    assert _code([str(export) if word == "EXPORT" else word for word in command]) == 2
    assert said in capsys.readouterr().err


def test_costs_are_read_like_exports(tmp_path: Path) -> None:
    from stiction_ros.cli.survey import _costs

    path = tmp_path / "cost.csv"
    path.write_text("loop;cost\nFIC1;3,5\nFIC2;2\n")
    assert _costs(str(path)) == {"FIC1": 3.5, "FIC2": 2.0}
    path.write_text("loop,cost\nFIC1,3.5\nFIC2,much\n")
    with pytest.raises(InputError, match=r"line 3: 'much' is no cost of loop FIC2"):
        _costs(str(path))
