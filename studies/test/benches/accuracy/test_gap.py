"""`stiction bench gap`: its log, its options, and a small fixed subset of blind loops."""

import json
from pathlib import Path
from typing import Any

import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_studies.benches.accuracy.gap import FIRST_SEED, GapBench, judge, read_log
from stiction_studies.blind.loops.generator import blind_loop
from stiction_studies.blind.scores.scoring import Score, Scored
from stiction_studies.blind.scores.tally import report

# Family and seed: gain, backlash, sine, a healthy loop, a gain that changes half-way.
SUBSET = (("single", 3), ("single", 201), ("single", 209), ("single", 212), ("outside", 202))


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> list[Scored]:
    log = tmp_path_factory.mktemp("gap") / "log.jsonl"
    return [judge(False, log, case) for case in SUBSET]


@pytest.mark.trial
@pytest.mark.slow
def test_nothing_of_the_subset_is_named_wrongly(judged: list[Scored]) -> None:
    wrong = {Score.WRONG, Score.ALARM, Score.LOST}
    assert not [(row.family, row.seed, row.said) for row in judged if row.score in wrong]


@pytest.mark.trial
@pytest.mark.slow
def test_most_of_the_subset_is_right(judged: list[Scored]) -> None:
    good = {Score.RIGHT, Score.QUIET, Score.UNKNOWN}
    assert sum(row.score in good for row in judged) >= 4


@pytest.mark.trial
@pytest.mark.slow
def test_effects_of_full_size_are_testable(judged: list[Scored]) -> None:
    assert [row.testable for row in judged] == [True, True, True, False, False]


def row(seed: int, **changes: Any) -> Scored:
    regime = {"process": "first", "tuning": "normal", "excitation": "moves"}
    values: dict[str, Any] = {
        "family": "single",
        "seed": seed,
        "cause": "valve slew",
        "regime": regime,
        "testable": True,
        "score": Score.RIGHT,
        "said": "valve slew",
        "closed": 0.95,
        "covered": {"slew.rate": True},
        "seconds": 3.0,
    }
    return Scored(**(values | changes))


def write_log(path: Path, rows: list[Scored], full: bool = False) -> None:
    lines = [json.dumps({"full": full} | entry.to_mapping()) for entry in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_a_finished_log_is_resumed_without_any_work(tmp_path: Path) -> None:
    log, out = tmp_path / "log.jsonl", tmp_path / "out.json"
    rows = [row(5), row(6, score=Score.WRONG, said="valve lag", closed=float("nan"))]
    write_log(log, rows)
    before = log.read_text()
    options = ["--first", "5", "--loops", "2", "--log", str(log), "--resume", "--json", str(out)]
    assert main(["bench", "gap", *options]) == 0
    assert log.read_text() == before
    assert json.loads(out.read_text()) == {"name": "gap"} | report(rows)


def test_only_rows_of_the_same_benchmark_count(tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    write_log(log, [row(5), row(9), row(6, family="two")])
    bench = GapBench(first=5, loops=3)
    assert set(read_log(log, bench, Scored.from_mapping)) == {("single", 5)}
    assert not read_log(log, GapBench(first=5, loops=3, full=True), Scored.from_mapping)


def test_without_a_log_nothing_is_done_yet(tmp_path: Path) -> None:
    assert read_log(tmp_path / "none.jsonl", GapBench(), Scored.from_mapping) == {}


@pytest.mark.parametrize("line", ["{", "[]", "{}", '{"full": false, "score": "lucky"}'])
def test_a_broken_log_is_named(line: str, tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    log.write_text(line + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="line 1"):
        read_log(log, GapBench(), Scored.from_mapping)


def test_loops_and_answers_are_written_apart(tmp_path: Path) -> None:
    where = str(tmp_path / "blind")
    assert main(["bench", "gap", "--first", "6", "--loops", "2", "--write", where]) == 0
    loops = tmp_path / "blind" / "loops"
    assert sorted(p.name for p in loops.iterdir()) == ["single_6", "single_7"]
    answer = json.loads((tmp_path / "blind" / "answers" / "single_7.json").read_text())
    assert answer["cause"] == blind_loop(7)[1].cause
    seen = " ".join(p.read_text() for p in (loops / "single_7").iterdir())
    assert answer["hidden"][0]["effect"] == "stiction"
    assert "stiction" not in seen


def test_reporting_seeds_are_the_default() -> None:
    assert GapBench().first == FIRST_SEED >= 10_000


def test_every_family_has_the_same_seeds() -> None:
    bench = GapBench(("single", "two"), 7, 2)
    assert bench.cases == [("single", 7), ("single", 8), ("two", 7), ("two", 8)]


@pytest.mark.parametrize(("option", "value"), [("--loops", "0"), ("--first", "-1")])
def test_values_out_of_range_are_one_line_and_exit_2(
    option: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "gap", option, value]) == 2
    assert option in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [["graph", "--loops", "3"], ["gap", "--repeat", "3"], ["graph", "--full"]]
)
def test_options_of_another_benchmark_are_refused(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", *arguments]) == 2
    assert "has no such option" in capsys.readouterr().err


def test_a_log_that_cannot_be_written_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "gap", "--loops", "1", "--log", str(tmp_path)]) == 2
    assert str(tmp_path) in capsys.readouterr().err
