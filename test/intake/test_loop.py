"""What a dry run shows of the values, and what is said of values that do not fit their unit."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import HEADER, iso, one, op, pv, read, said, sp, table, text, write

from stiction_ros.cli.main import main
from stiction_ros.intake.intake_options import OpUnit


def column(path: Path, values: list[float], name: str = "OP") -> Path:
    """Write a loop with another OP."""
    rows = [[iso(k), f"{value:.4f}", str(pv(k))] for k, value in enumerate(values)]
    return write(path, text(rows, ["time", name, "PV"]))


def around(middle: float, span: float) -> list[float]:
    random = np.random.default_rng(4)
    return (middle + span * (random.random(120) - 0.5)).tolist()


def test_a_dry_run_shows_values_and_modes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [[*row, "MAN" if k < 20 else "AUTO"] for k, row in enumerate(table())]
    rows[50][1] = "-9999"
    path = write(tmp_path / "a.csv", text(rows, [*HEADER, "MODE"]))
    assert main(["identify", str(path), "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert "  OP V1 from OP: 40 to 60, median 5" in out
    assert "  SP PV1 from SP: 200 to 200, median 200" in out
    assert "  MODE from MODE: 100 AUTO (automatic), 20 MAN (not automatic)" in out


def test_a_loop_that_is_refused_shows_its_values_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [[*row, "P1" if k < 40 else "Q1"] for k, row in enumerate(table())]
    path = write(tmp_path / "a.csv", text(rows, [*HEADER, "MODE"]))
    assert main(["identify", str(path), "--dry-run"]) == 1
    out = capsys.readouterr().out
    assert "  PV PV1 from PV: 19" in out
    assert "  MODE from MODE: 80 Q1, 40 P1" in out


@pytest.mark.parametrize(("name", "option"), [("OP [%]", None), ("OP", OpUnit.PERCENT)])
def test_an_op_far_outside_of_its_unit_is_refused(
    tmp_path: Path, name: str, option: OpUnit | None
) -> None:
    path = column(tmp_path / "a.csv", around(314.0, 4.0), name)
    problem = str(one(path, op_unit=option).problem)
    assert f"{name} holds 312" in problem
    assert "--op-unit other" in problem
    assert one(path, op_unit=OpUnit.OTHER).problem is None


def test_headers_exchanged_are_called_swapped(tmp_path: Path) -> None:
    rows = [[iso(k), str(pv(k)), str(op(k)), str(sp(k))] for k in range(120)]
    for name in ("TIC1.OP [%]", "TIC1.OP"):
        header = ["time", name, "TIC1.PV", "TIC1.SP"]
        problem = str(one(write(tmp_path / "a.csv", text(rows, header))).problem)
        assert f"OP and PV look swapped: {name} stays near the set-point TIC1.SP" in problem
        assert "name them, --op TIC1=TIC1.PV --pv " in problem


def test_a_small_op_without_its_mean_is_not_called_swapped(tmp_path: Path) -> None:
    rows = [
        [iso(k), f"{small:.5f}", f"{large:.4f}", "0"]
        for k, (small, large) in enumerate(zip(around(0.0, 0.05), around(0.0, 2.0), strict=True))
    ]
    path = write(tmp_path / "a.csv", text(rows, HEADER))
    assert "swapped" not in str(one(path, op_unit=OpUnit.OTHER).problem)


def test_a_share_is_refused_where_it_is_none(tmp_path: Path) -> None:
    path = column(tmp_path / "a.csv", around(10.0, 0.9))
    assert "though OP is said to be in 0 to 1" in str(one(path, op_unit=OpUnit.SHARE).problem)
    path = column(tmp_path / "b.csv", around(0.52, 1.0))
    assert one(path, op_unit=OpUnit.SHARE).problem is None


def test_an_op_without_its_mean_is_noted(tmp_path: Path) -> None:
    loop = one(column(tmp_path / "a.csv", around(0.0, 60.0), "OP [%]"))
    assert loop.problem is None
    assert "perhaps without its mean" in said(loop)


def test_what_looks_like_a_current_is_told(tmp_path: Path) -> None:
    path = column(tmp_path / "a.csv", around(10.0, 0.9))
    assert "if it is a current say --op-unit ma" in said(one(path))
    assert "current" not in said(one(column(tmp_path / "b.csv", around(10.0, 0.9), "OP [%]")))
    assert one(path, op_unit=OpUnit.CURRENT).parts[0].op.mean() == pytest.approx(37.5, abs=1.0)


def test_a_mode_that_says_nothing_is_told(tmp_path: Path) -> None:
    rows = [[*row, "RUN7"] for row in table()]
    path = write(tmp_path / "a.csv", text(rows, [*HEADER, "MODE"]))
    loop = one(path)
    assert "MODE shows RUN7 alone, which is not known: taken as automatic" in said(loop)
    assert "--auto WORD" in said(loop)
    assert loop.signals[-1] == "MODE from MODE: 120 RUN7 (automatic)"
    assert "RUN7" not in said(one(path, automatic=("RUN7",)))


def test_what_is_missing_is_counted_once(tmp_path: Path) -> None:
    lines = ["tag,time,value,quality"]
    for k in range(120):
        for name, value in (("OP", op(k)), ("PV", pv(k))):
            bad = name == "PV" and k in (30, 31)
            shown = "Bad" if bad else f"{value}"
            lines.append(f"F1.{name},{iso(k)},{shown},{'Bad' if bad else 'Good'}")
    loop = one(write(tmp_path / "a.csv", "\n".join(lines)))
    assert "F1.PV: 2 values of 120 missing (2 'Bad')" in said(loop)


def test_empty_cells_of_other_rows_are_not_counted(tmp_path: Path) -> None:
    header = ["time", "F1.OP", "F1.PV", "F2.OP", "F2.PV"]
    rows = [[iso(k), str(op(k)), str(pv(k)), str(op(k)), str(pv(k))] for k in range(120)]
    for k in range(0, 120, 3):
        rows[k][1] = rows[k][2] = ""
    rows[31][2] = ""
    path = write(tmp_path / "a.csv", text(rows, header))
    told = {loop.name: said(loop) for loop in read(path)}
    assert "F1.PV: 1 value of 80 missing (1 empty)" in told["F1"]


def test_all_columns_that_are_missing_are_named_at_once(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", text(table(), ["when", "Stell", "Ist", "Soll"]))
    problem = str(one(path).problem)
    assert "has no columns OP and PV; its columns are when, Stell, Ist, Soll" in problem
    assert "--op TAG=COLUMN --pv TAG=COLUMN [--sp TAG=COLUMN]" in problem
    rows = [["x", *row[1:]] for row in table()]
    path = write(tmp_path / "b.csv", text(rows, ["when", "Stell", "Ist", "Soll"]))
    assert "has no columns OP, PV and t;" in str(one(path).problem)
