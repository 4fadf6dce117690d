"""`stiction bench world`: its options, its log, one loop judged."""

import json
from pathlib import Path

import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_studies.benches.accuracy.world import FIRST_SEED, WorldBench, judge
from stiction_studies.field.hidden import hidden_loop


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a log of two loops."""
    path = tmp_path_factory.mktemp("world") / "log.jsonl"
    for seed in (9, 10):
        judge(False, path, ("single", "exact", seed))
    return path


@pytest.mark.trial
def test_a_finished_log_is_resumed_without_any_work(log: Path, tmp_path: Path) -> None:
    before, out = log.read_text(), tmp_path / "out.json"
    options = ["--first", "9", "--loops", "2", "--log", str(log), "--resume", "--json", str(out)]
    assert main(["bench", "world", *options]) == 0
    assert log.read_text() == before
    document = json.loads(out.read_text())
    assert document["name"] == "world"
    assert [row["seed"] for row in document["rows"]] == [9, 10]
    assert document["rows"][0]["oracle"][0]["effect"] == "quantisation"
    assert "rates" in document["parts"]["single, exact"]


def test_a_broken_log_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = tmp_path / "log.jsonl"
    broken.write_text("{}\n", encoding="utf-8")
    options = ["--first", "9", "--loops", "1", "--log", str(broken), "--resume"]
    assert main(["bench", "world", *options]) == 2
    assert "line 1" in capsys.readouterr().err


def test_loops_and_answers_are_written_apart(tmp_path: Path) -> None:
    where = str(tmp_path / "world")
    assert main(["bench", "world", "--first", "9", "--loops", "1", "--write", where]) == 0
    seen = tmp_path / "world" / "loops" / "single_exact_9"
    answer = json.loads((tmp_path / "world" / "answers" / "single_exact_9.json").read_text())
    assert answer["hidden"][0]["name"] == "quantisation"
    assert "quantisation" not in (seen / "model.loop.yaml").read_text()
    rows = (seen / "record.csv").read_text().splitlines()
    assert len(rows) == len(hidden_loop(9).record) + 1


def test_reporting_seeds_are_the_default() -> None:
    assert WorldBench().first == FIRST_SEED >= 100_000


def test_every_family_and_model_has_the_same_seeds() -> None:
    bench = WorldBench(("single", "two"), 7, 1, givens=("exact", "off"))
    assert bench.cases == [
        ("single", "exact", 7),
        ("single", "off", 7),
        ("two", "exact", 7),
        ("two", "off", 7),
    ]


@pytest.mark.parametrize("changes", [{"loops": 0}, {"first": -1}, {"families": ("outside",)}])
def test_benchmarks_that_cannot_be_run_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InputError):
        WorldBench(**changes)  # type: ignore[arg-type]


@pytest.mark.trial
@pytest.mark.trial
def test_physics_is_of_this_world_alone(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "gap", "--family", "physics", "--family", "single"]) == 2
    assert "by itself" in capsys.readouterr().err
    mine = tmp_path / "log.jsonl"
    judge(False, mine, ("physics", "exact", 2))
    options = ["--first", "2", "--loops", "1", "--log", str(mine), "--resume", "--json", "-"]
    assert main(["bench", "gap", "--family", "physics", *options]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["name"] == "world"
    assert document["rows"][0]["cause"].startswith("valve stiction")
