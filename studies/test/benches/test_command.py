"""`stiction bench identification`: the rows and their arithmetic, on small data."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_studies.benches.speed import identification as bench_identification
from stiction_studies.benches.speed.identification import FULL, Duel, Plan, identification
from stiction_studies.examples import Example, example1

TINY = Plan(
    duels=(Duel(lambda seed: short_example1(seed), "Example 1", 1, 4.0, 3),),
    lengths=(400, 800, 2000),
    valves=(1, 2),
    loop_samples=300,
    delay=(5, 5),
    longest=800,
    repeat=1,
)
KEYS = {"case", "subject", "baseline", "subject_ms", "baseline_ms", "p99_ms", "ratio", "note"}


def short_example1(seed: int) -> Example:
    return example1(seed, samples=300)


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the command writes, with a small plan in place of the quick one."""
    path: Path = tmp_path_factory.mktemp("bench") / "rows.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench_identification, "QUICK", TINY)
        arguments = ["bench", "identification", "--quick", "--seed", "3", "--json", str(path)]
        assert main(arguments) == 0
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def rows_of(document: dict[str, Any], start: str) -> list[dict[str, Any]]:
    return [row for row in document["rows"] if row["case"].startswith(start)]


@pytest.mark.trial
def test_the_document_is_the_contract_s(document: dict[str, Any]) -> None:
    assert document.keys() == {"name", "machine", "rows"}
    assert document["name"] == "identification"
    assert all(row.keys() == KEYS for row in document["rows"])


@pytest.mark.trial
def test_every_comparison_has_its_row(document: dict[str, Any]) -> None:
    cases = [row["case"].split(",")[0] for row in document["rows"]]
    wanted = [*["Example 1"] * 4, "N = 400", "N = 800", "m = 1", "m = 2"]
    assert cases == wanted


@pytest.mark.trial
def test_ratio_is_baseline_over_subject(document: dict[str, Any]) -> None:
    for row in document["rows"]:
        assert row["subject_ms"] > 0.0
        assert row["ratio"] == pytest.approx(row["baseline_ms"] / row["subject_ms"])
        assert row["p99_ms"] >= row["subject_ms"]


@pytest.mark.trial
def test_both_methods_of_the_paper_meet_the_same_runs(document: dict[str, Any]) -> None:
    nlp, grid, *default = rows_of(document, "Example 1")
    assert nlp["subject_ms"] == grid["subject_ms"]
    assert [row["subject"] for row in default] == ["evidence", "evidence"]
    assert [row["baseline_ms"] for row in default] == [nlp["baseline_ms"], grid["baseline_ms"]]


@pytest.mark.trial
def test_longer_records_are_measured_against_proportional_growth(document: dict[str, Any]) -> None:
    short, long = rows_of(document, "N = ")
    assert short["ratio"] == 1.0
    assert long["baseline_ms"] == pytest.approx(2.0 * short["subject_ms"])


@pytest.mark.trial
def test_records_that_were_left_out_are_named(document: dict[str, Any]) -> None:
    assert rows_of(document, "N = ")[-1]["note"].endswith("N = 2000 left out")


@pytest.mark.trial
def test_more_valves_are_measured_against_so_many_times_one(document: dict[str, Any]) -> None:
    one, two = rows_of(document, "m = ")
    assert two["baseline_ms"] == pytest.approx(2.0 * one["subject_ms"])


@pytest.mark.trial
def test_the_paper_s_methods_are_run_in_full_and_tell_their_work(document: dict[str, Any]) -> None:
    nlp, grid, *_ = rows_of(document, "Example 1")
    assert (nlp["baseline"], grid["baseline"]) == ("paper's NLP, M = 1", "paper's grid, step 4 %")
    assert " solves, " in nlp["note"]
    assert " points, all of them worked through" in grid["note"]
    assert "extrapolated" not in nlp["note"] + grid["note"]


@pytest.mark.trial
def test_settings_of_the_paper_s_methods_can_be_chosen() -> None:
    plan = dataclasses.replace(TINY, lengths=(300,), valves=(), friction_limit=6.0, grid_step=3.0)
    nlp, grid = identification(plan, lambda share, text: None)[:2]
    assert "f_max 6 %" in nlp.note
    assert grid.baseline == "paper's grid, step 3 %"
    assert "6 points" in grid.note


def test_the_full_run_covers_what_was_asked() -> None:
    assert [(duel.title, duel.starts, duel.step, duel.order) for duel in FULL.duels] == [
        ("Example 1", 7, 0.1, 3),
        ("Example 2, one round", 5, 1.0, 5),
    ]
    assert FULL.delay is None
    assert (FULL.lengths[0], FULL.lengths[-1], FULL.longest) == (2500, 100_000, 100_000)
    assert FULL.valves == (1, 2, 3)


@pytest.mark.parametrize(
    ("option", "value"), [("--repeat", "0"), ("--longest", "100"), ("--seed", "-1")]
)
def test_values_out_of_range_are_one_line_and_exit_2(
    option: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "identification", option, value]) == 2
    assert option in capsys.readouterr().err


def test_the_other_benchmark_refuses_these_options(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "graph", "--quick"]) == 2
    assert "benchmark graph has no such option" in capsys.readouterr().err


@pytest.mark.trial
def test_the_bar_runs_from_start_to_end() -> None:
    shares: list[float] = []
    plan = Plan(duels=(), lengths=(300,), valves=(), delay=(5, 5), longest=300, repeat=2)
    identification(plan, lambda share, text: shares.append(share))
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_a_plan_says_what_is_wrong_with_it() -> None:
    with pytest.raises(InputError, match="below the shortest record"):
        Plan(duels=(), lengths=(2500,), longest=100)
