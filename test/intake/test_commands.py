"""Commands read exports, and say what they read."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import HEADER, iso, op, pv, table, text, write

from stiction_ros.cli.main import main


def sticky(path: Path) -> Path:
    """Write a loop with He's valve, f_S 5, f_D 2, on a PI controller."""
    rng = np.random.default_rng(5)
    y, u, stem, before, rows = 0.0, 50.0, 50.0, 0.0, []
    for k in range(700):
        y = 0.9 * y + 0.1 * (stem - 50.0) + 0.02 * rng.standard_normal()
        u += -0.6 * (y - before) - 0.15 * y
        before = y
        if abs(u - stem) > 5.0:
            stem = u - 2.0 * float(np.sign(u - stem))
        rows.append([iso(k), repr(u), repr(y + 80.0), "80.0"])
    return write(path, text(rows))


@pytest.mark.trial
def test_identify_says_sample_time_unit_and_span(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = sticky(tmp_path / "FIC1.csv")
    assert main(["identify", str(path), "--na", "1", "--delay", "0:3"]) == 0
    out = capsys.readouterr().out
    assert "FIC1: 700 samples, one each 10 s, 2024-10-17 21:55:00 to " in out
    assert "OP in %" in out
    assert main(["identify", str(path), "--na", "1", "--delay", "0:3", "--json", "-"]) == 0
    captured = capsys.readouterr()
    assert "one each 10 s" in captured.err
    assert json.loads(captured.out)["sample_time"] == 10.0


def test_dry_run_shows_where_every_signal_comes_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header = ["time", *(f"{tag}.{name}" for tag in ("FIC1", "FIC2") for name in ("OP", "PV"))]
    rows = [[iso(k), str(op(k)), str(pv(k)), str(op(k)), str(pv(k))] for k in range(99)]
    rows[9][4] = "Bad"
    path = write(tmp_path / "a.csv", text(rows, header))
    assert main(["identify", str(path), "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert "FIC1 (a.csv): 99 samples, one each 10 s" in out
    assert "  OP FIC2 from FIC2.OP" in out
    assert "  note: FIC2.PV: 1 value of 99 missing (1 'Bad')" in out
    assert main(["identify", str(tmp_path / "none.csv"), "--dry-run"]) == 1
    assert "not read: " in capsys.readouterr().out


def test_one_of_several_loops_is_chosen_by_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header = ["time", *(f"{tag}.{name}" for tag in ("FIC1", "FIC2") for name in ("OP", "PV"))]
    rows = [[iso(k), str(op(k)), str(pv(k)), str(2 * op(k)), str(pv(k))] for k in range(99)]
    path = write(tmp_path / "a.csv", text(rows, header))
    assert main(["convert", str(path), str(tmp_path / "b.csv")]) == 2
    assert "holds several loops: FIC1, FIC2; choose one with --loop NAME" in capsys.readouterr().err
    assert main(["convert", str(path), str(tmp_path / "b.csv"), "--loop", "fic2"]) == 0
    line = (tmp_path / "b.csv").read_text().splitlines()[1].split(",")
    assert float(line[1]) == 2 * op(0)
    assert main(["convert", str(path), str(tmp_path / "b.csv"), "--loop", "FIC9"]) == 2
    assert "has no loop FIC9: FIC1, FIC2" in capsys.readouterr().err


def test_strict_refuses_what_is_repaired_otherwise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = table()
    rows[7][1] = "Bad"
    path = write(tmp_path / "a.csv", text(rows, HEADER))
    assert main(["convert", str(path), str(tmp_path / "b.csv")]) == 0
    assert "OP: 1 value of 120 missing" in capsys.readouterr().err
    assert main(["convert", str(path), str(tmp_path / "c.csv"), "--strict"]) == 2
    assert "OP: 1 value of 120 missing (1 'Bad'), first: line 9" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--sample-time", "-1"], "is no sample time"),
        (["--tags", "{tags}"], "a tag list has the columns"),
    ],
)
def test_options_that_cannot_be_meant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    path = write(tmp_path / "a.csv", text(table()))
    tags = write(tmp_path / "tags.csv", "x,y\n1,2\n")
    chosen = [word.format(tags=tags) for word in arguments]
    assert main(["identify", str(path), *chosen]) == 2
    assert said in capsys.readouterr().err
