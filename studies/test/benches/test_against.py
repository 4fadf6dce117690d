"""`stiction bench … --against DIR`: two trees in turns, matched by case and subject."""

import json
import sys
from pathlib import Path

import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_studies.benches.against import (
    CPU,
    ELAPSED,
    HERE,
    THERE,
    WHOLE,
    alternate,
    measured,
    repeated,
)

PYTHON = """#!/bin/sh
echo "$*" >> {log}
{then}
"""


def row(case: str, subject: str, ms: float, base: float) -> dict[str, object]:
    return {
        "case": case,
        "subject": subject,
        "baseline": "yardstick",
        "subject_ms": ms,
        "baseline_ms": base,
        "p99_ms": ms,
        "ratio": base / ms,
        "note": "",
    }


def tree(directory: Path, then: str) -> Path:
    """Return a worktree whose interpreter notes how it was called, and does ``then``."""
    python = directory / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(PYTHON.format(log=directory / "calls", then=then), encoding="utf-8")
    python.chmod(0o755)
    return directory


def printing(directory: Path, *rows: dict[str, object]) -> Path:
    """Return a worktree that prints these rows at every call."""
    document = json.dumps({"name": "control", "rows": rows})
    return tree(directory, f"cat <<'END'\n{document}\nEND")


@pytest.fixture
def trees(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """This tree and the other one, which is twice as slow beside the same yardstick."""
    mine, theirs = row("tank", "SU", 2.0, 10.0), row("tank", "SU", 4.0, 10.0)
    again = row("tank", "SU", 3.0, 99.0)
    here = printing(tmp_path / "here", mine, again, row("new case", "SE", 1.0, 1.0))
    there = printing(tmp_path / "there", theirs, row("old case", "SE", 1.0, 1.0))
    monkeypatch.setattr(sys, "executable", str(here / ".venv" / "bin" / "python"))
    return here, there


def test_ratios_are_those_of_the_other_tree_over_this_one(trees: tuple[Path, Path]) -> None:
    ran = alternate(["bench", "control", "--quick"], trees[1], 2, lambda share, text: None)
    tank, *whole = ran.rows()
    assert (tank.case, tank.subject, tank.baseline) == ("tank", f"SU, {HERE}", THERE)
    assert (tank.subject_ms, tank.baseline_ms, tank.ratio) == (2.0, 4.0, 2.0)
    assert tank.note == "medians of 2 runs; what each tree measures itself against: 1.000"
    assert [(one.case, one.subject) for one in whole] == [
        (WHOLE, f"{CPU}, {HERE}"),
        (WHOLE, f"{ELAPSED}, {HERE}"),
    ]
    assert all(one.subject_ms > 0.0 and one.baseline_ms > 0.0 for one in whole)


def test_what_one_tree_alone_measures_is_told(trees: tuple[Path, Path]) -> None:
    ran = alternate(["bench", "control"], trees[1], 1, lambda share, text: None)
    assert ran.alone() == [f"{HERE} alone has new case (SE)", f"{THERE} alone has old case (SE)"]


def test_trees_take_turns_and_change_who_begins(trees: tuple[Path, Path]) -> None:
    order: list[str] = []
    alternate(["bench", "control"], trees[1], 3, lambda share, text: order.append(text))
    assert [text.partition(", ")[2] for text in order] == [HERE, THERE, THERE, HERE, HERE, THERE]
    for directory in trees:
        calls = (directory / "calls").read_text(encoding="utf-8").splitlines()
        assert calls == ["-P -m stiction_ros.cli.main bench control --json -"] * 3


def test_the_processor_s_time_holds_what_a_run_s_own_children_took(
    trees: tuple[Path, Path], tmp_path: Path
) -> None:
    burn = "import time; begun = time.process_time()\nwhile time.process_time() - begun < 0.3: pass"
    busy = tree(tmp_path / "busy", f"{sys.orig_argv[0]} -c '{burn}'\necho '{{}}'")
    ran = alternate(["bench", "control"], busy, 1, lambda share, text: None)
    assert ran.there[0].times[WHOLE, CPU] >= 300.0


def test_the_command_takes_its_own_words_away(
    trees: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "rows.json"
    words = ["bench", "control", "--seed", "3", "--against", str(trees[1]), "--turns", "1"]
    assert main([*words, f"--json={out}"]) == 0
    assert (trees[1] / "calls").read_text(encoding="utf-8").split()[-5:] == [
        "control",
        "--seed",
        "3",
        "--json",
        "-",
    ]
    document = json.loads(out.read_text(encoding="utf-8"))
    assert document.keys() == {"name", "machine", "rows"}
    assert [one["case"] for one in document["rows"]] == ["tank", WHOLE, WHOLE]
    assert "alone has old case (SE)" in capsys.readouterr().err


def test_words_that_are_not_the_runs_own_are_left_out() -> None:
    words = ["bench", "--json", "-", "gap", "--against=old", "--loops", "3", "--turns", "5"]
    assert repeated(words) == ["bench", "gap", "--loops", "3"]


def test_benchmarks_that_count_have_no_rows_of_times() -> None:
    assert measured({"name": "field", "rows": [{"seed": 3, "verdict": "sticky"}]}) == ({}, {})


def test_a_tree_without_an_environment_is_told(tmp_path: Path) -> None:
    assert main(["bench", "control", "--against", str(tmp_path)]) == 2
    with pytest.raises(InputError, match=r"no environment of its own.*make setup"):
        alternate(["bench"], tmp_path, 1, lambda share, text: None)


def test_a_run_that_fails_is_told_with_its_last_line(
    trees: tuple[Path, Path], tmp_path: Path
) -> None:
    broken = tree(tmp_path / "broken", "echo first >&2; echo unknown option >&2; exit 2")
    with pytest.raises(InputError, match=f"{THERE} ended with 2: unknown option"):
        alternate(["bench", "control"], broken, 1, lambda share, text: None)


@pytest.mark.parametrize("words", [["--turns", "2"], ["--against", ".", "--turns", "0"]])
def test_turns_need_another_tree_and_at_least_one(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "control", *words]) == 2
    assert "--turns" in capsys.readouterr().err
