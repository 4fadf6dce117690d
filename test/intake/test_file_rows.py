"""Rows of a tag list that count for one file alone."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import check, iso, op, pv, read, table, text, write

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.intake import Loop
from stiction_ros.intake.intake_options import OpUnit


def plant(folder: Path, rows: str, **options: object) -> dict[str, Loop]:
    """Return the loops of a folder by their names, read with a tag list of these rows."""
    tags = write(folder / "tags.csv", rows)
    return {loop.name: loop for loop in read(folder, tags=tags, **options)}


def shares() -> list[list[str]]:
    return [[t, str(float(u) / 100.0), y, s] for t, u, y, s in table()]


def test_files_of_one_loop_have_the_same_columns(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", text(table()))
    write(tmp_path / "b.csv", text(table()))
    found = plant(tmp_path, "file,loop,pv,sp,op\na.csv,FIC1,PV,SP,OP\nb.csv,FIC2,PV,SP,OP\n")
    assert list(found) == ["FIC1", "FIC2"]
    check(found["FIC1"])
    check(found["FIC2"])


def test_without_a_file_a_tag_stands_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"line 3: tag PV is there twice; .* with the file"):
        plant(tmp_path, "loop,pv,sp,op\nFIC1,PV,SP,OP\nFIC2,PV,SP,OP\n")


@pytest.mark.parametrize(
    "rows",
    [
        "file,op_unit\nb.csv,share\n",
        "file,loop,op_unit\nb.csv,b,share\n",
        "file,loop,pv,sp,op,op_unit\nb.csv,b,PV,SP,OP,share\n",
        "file,tag,loop,signal,op_unit\nb.csv,PV,b,PV,\nb.csv,OP,b,OP,share\n",
    ],
)
@pytest.mark.parametrize("unit", [None, OpUnit.PERCENT])
def test_one_file_counts_op_as_a_share(tmp_path: Path, rows: str, unit: OpUnit | None) -> None:
    write(tmp_path / "a.csv", text(table()))
    write(tmp_path / "b.csv", text(shares()))
    found = plant(tmp_path, rows, op_unit=unit)
    assert list(found) == ["a", "b"]
    check(found["a"])
    check(found["b"])


def test_columns_of_one_file_have_other_names(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", text(table()))
    write(tmp_path / "b.csv", text(table(), ["when", "Stell", "Ist", "Soll"]))
    found = plant(
        tmp_path, "file,loop,pv,sp,op,time\nb.csv,FIC2,Ist,Soll,Stell,when\n", op_unit=None
    )
    check(found["a"])
    check(found["FIC2"])


def test_a_row_names_columns_that_look_swapped(tmp_path: Path) -> None:
    rows = [[t, y, u, s] for t, u, y, s in table()]
    write(tmp_path / "a.csv", text(rows, ["time", "OP [%]", "PV", "SP"]))
    found = plant(tmp_path, "file,loop,pv,sp,op\na.csv,a,OP [%],SP,PV\n")
    assert any(said.startswith("OP a from PV: ") for said in found["a"].signals)


def test_the_dates_of_one_file(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        rows = [[f"05/06/2024 10:{k // 6:02d}:{k % 6}0", *r[1:]] for k, r in enumerate(table())]
        write(tmp_path / name, text(rows))
    found = plant(tmp_path, "file,dates\na.csv,dmy\nb.csv,mdy\n")
    days = [found[name].parts[0].start for name in ("a", "b")]
    assert days[0] - days[1] == 30.0 * 86400.0


def test_the_unit_of_times_of_one_file(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        write(tmp_path / name, text(table(lambda k: str(10000 * k))))
    found = plant(tmp_path, "file,time_unit\nb.csv,ms\n")
    assert "a row for this file in --tags" in str(found["a"].problem)
    check(found["b"])


def test_the_sample_time_of_one_file_stands_below_a_row_of_words(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", text(shares()))
    write(tmp_path / "b.csv", text(table()))
    found = plant(tmp_path, "file,op_unit,sample_time\na.csv,share,\nb.csv,,20\n")
    check(found["a"])
    assert found["b"].parts[0].sample_time == 20.0


def test_files_beside_a_row_are_read_as_without_a_list(tmp_path: Path) -> None:
    names = ["time", "F1.OP", "F1.PV", "F2.OP", "F2.PV"]
    rows = [[iso(k), str(op(k)), str(pv(k)), str(op(k)), str(pv(k))] for k in range(120)]
    write(tmp_path / "a.csv", text(rows, names))
    write(tmp_path / "b.csv", text(table()))
    found = plant(tmp_path, "file,loop,pv,op\nb.csv,F3,PV,OP\n")
    assert sorted(found) == ["F1", "F2", "F3"]
    check(found["F2"])


def test_rows_of_a_file_count_before_those_of_all(tmp_path: Path) -> None:
    names = ["time", "FY1", "FT1", "FS1"]
    write(tmp_path / "a.csv", text(table(), names))
    write(tmp_path / "b.csv", text(table(), names))
    found = plant(tmp_path, "file,loop,pv,sp,op\n,F1,FT1,FS1,FY1\nb.csv,F2,FT1,FS1,FY1\n")
    assert [found[name].files[0].name for name in ("F1", "F2")] == ["a.csv", "b.csv"]


def test_one_value_a_row_has_tags_of_its_own_file(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        rows = [[tag, iso(k), str(at(k))] for k in range(120) for tag, at in (("Y", op), ("T", pv))]
        write(tmp_path / name, text(rows, ["tag", "time", "value"]))
    found = plant(tmp_path, "file,loop,pv,op\na.csv,F1,T,Y\nb.csv,F2,T,Y\n")
    check(found["F1"])
    check(found["F2"])


def test_a_loop_of_two_files_has_op_in_one_unit(tmp_path: Path) -> None:
    names = ["time", "F1.OP", "F1.PV", "F1.SP"]
    write(tmp_path / "a.csv", text(table(), names))
    write(tmp_path / "b.csv", text(shares(), names))
    found = plant(tmp_path, "file,op_unit\nb.csv,share\n")
    assert "the unit of OP of F1 is not the same in all its files" in str(found["F1"].problem)


def test_the_end_of_a_path_tells_files_of_one_name_apart(tmp_path: Path) -> None:
    write(tmp_path / "north" / "a.csv", text(table()))
    write(tmp_path / "south" / "a.csv", text(shares()))
    found = plant(tmp_path, "file,op_unit\nsouth\\a.csv,share\n")
    check(found["a"])
    check(found["a (south)"])


def test_a_file_that_may_be_two_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "north" / "a.csv", text(table()))
    write(tmp_path / "south" / "a.csv", text(table()))
    with pytest.raises(InputError, match=r"tags.csv: line 2: a.csv may be .*north.* or .*south"):
        plant(tmp_path, "file,op_unit\na.csv,share\n")


def test_a_file_that_is_not_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "a.csv", text(table()))
    tags = write(tmp_path / "tags.csv", "file,op_unit\na.csv,percent\nc.csv,share\n")
    assert main(["survey", str(tmp_path), "--tags", str(tags), "--dry-run"]) == 0
    shown = capsys.readouterr()
    assert "1 loop, 1 can be read" in shown.out
    assert f"{tags}: no export is called c.csv\n" in shown.err


def test_a_column_that_the_file_lacks_is_told(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", text(table()))
    (loop,) = plant(tmp_path, "file,loop,pv,op\na.csv,F1,Ist,OP\n").values()
    assert "has no column Ist; its columns are time, OP, PV, SP; correct" in str(loop.problem)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("file,dates\na.csv,ymd\n", "line 2: dates ymd is unknown; use dmy, mdy"),
        ("file,time_unit\na.csv,weeks\n", "line 2: time_unit weeks is unknown; use ms"),
        ("file,op_unit,sample_time\na.csv,,-1\n", "line 2: sample_time -1 is none"),
        ("file,op_unit\na.csv,rpm\n", "line 2: unit 'rpm' of OP is unknown"),
        ("file,loop,pv,op\na.csv,,PV,OP\n", "line 2: names tags and no loop"),
    ],
)
def test_cells_that_cannot_be_meant(tmp_path: Path, rows: str, said: str) -> None:
    write(tmp_path / "a.csv", text(table()))
    with pytest.raises(InputError) as error:
        plant(tmp_path, rows)
    assert said in str(error.value)


def test_rows_of_a_file_that_contradict_each_other(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", text(table()))
    (loop,) = plant(tmp_path, "file,dates\na.csv,dmy\na.csv,mdy\n").values()
    assert "line 3: dates of a.csv is mdy here and dmy above" in str(loop.problem)
