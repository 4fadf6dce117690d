"""Tables of other shapes than time, OP, PV side by side."""

import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import (
    HEADER,
    ROWS,
    STEP,
    check,
    iso,
    one,
    op,
    pv,
    read,
    said,
    styled,
    table,
    text,
    write,
)

from stiction_ros.intake import CsvColumns, Loop
from stiction_ros.records.record import Quality


def long(tag: str = "FIC7.{}", rows: int = ROWS) -> list[list[str]]:
    """Tag, time, value."""
    values = (("PV", pv), ("OP", op), ("SP", lambda k: 200.0))
    return [
        [tag.format(name), iso(k), str(value(k))] for k in range(rows) for name, value in values
    ]


@pytest.mark.parametrize(
    "header",
    [
        ["path", "timestamp", "value"],
        ["_NAME", "_TIMESTAMP", "_VALUE"],
        ["NAME", "IP_TREND_TIME", "IP_TREND_VALUE"],
        ["Messstelle", "Zeitpunkt", "Messung"],
        ["A", "B", "C"],
    ],
)
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_one_value_a_row_under_any_header(
    tmp_path: Path, header: list[str], order: tuple[int, ...]
) -> None:
    rows = [[row[k] for k in order] for row in long()]
    check(one(write(tmp_path / "a.csv", text(rows, [header[k] for k in order]))))


def test_one_value_a_row_beside_counts_and_qualities(tmp_path: Path) -> None:
    rows = [
        [str(k), tag, time.replace("-", "/"), value.replace(".", ","), "1", f"{4.5e10 + k:.4f}"]
        for k, (tag, time, value) in enumerate(long())
    ]
    rows.append(["360", "$END$", "", "360", "", ""])
    header = ["No", "VarName", "TimeString", "VarValue", "Validity", "Time_ms"]
    loop = one(write(tmp_path / "a.csv", text(rows, header, mark=";")))
    check(loop)
    assert loop.notes == ()


def test_the_column_of_the_value_is_asked_for(tmp_path: Path) -> None:
    rows = [[*row, str(3.0 + k % 7)] for k, row in enumerate(long())]
    path = write(tmp_path / "a.csv", text(rows, ["A", "B", "C", "D"]))
    assert "such as --long A,B,C" in str(one(path).problem)
    check(one(path, long=("A", "B", "C")))


def shifted(first: list[str], late: int = 10) -> str:
    """Times of OP begin late; each row holds samples of several times."""
    rows = [
        [iso(k), str(pv(k)), iso(k + late), str(op(k + late)), iso(k), "200.0"] for k in range(ROWS)
    ]
    return text(rows, first)


def check_shifted(loop: Loop, late: int = 10) -> None:
    assert loop.problem is None
    (record,) = loop.parts
    first = round((record.start - 1729202100.0) / STEP)
    for row in np.flatnonzero(record.quality == Quality.GOOD).tolist():
        assert record.op[row, 0] == op(first + row)
        assert record.pv[row, 0] == pv(first + row)
    assert np.count_nonzero(record.quality == Quality.GOOD) == ROWS - late


@pytest.mark.parametrize(
    "header",
    [
        ["Timestamp", "F.PV", "Timestamp", "F.OP", "Timestamp", "F.SP"],
        ["Timestamp", "F.PV", "Timestamp2", "F.OP", "Timestamp3", "F.SP"],
        ["F.PV at", "F.PV", "F.OP at", "F.OP", "F.SP at", "F.SP"],
        ["Time", "PV", "Time", "OP", "Time", "SP"],
    ],
)
def test_each_tag_by_its_own_time(tmp_path: Path, header: list[str]) -> None:
    loop = one(write(tmp_path / "a.csv", shifted(header)))
    check_shifted(loop)
    assert f"signals have times of their own: {header[1]} in column 1 {header[0]}" in said(loop)


def test_times_may_stand_behind_their_tags_and_be_of_other_lengths(tmp_path: Path) -> None:
    rows = [[str(pv(k)), iso(k), str(op(k)), iso(k)] for k in range(ROWS)]
    rows += [[str(pv(k)), iso(k), "", ""] for k in range(ROWS, ROWS + 3)]
    loop = one(write(tmp_path / "a.csv", text(rows, ["PV", "time", "OP", "time"])))
    (record,) = loop.parts
    np.testing.assert_allclose(record.op[:ROWS, 0], [op(k) for k in range(ROWS)])
    assert "without a time" not in said(loop)


def test_date_and_time_of_day_for_each_tag(tmp_path: Path) -> None:
    rows = [[*iso(k).split(), str(pv(k)), *iso(k + 1).split(), str(op(k + 1))] for k in range(ROWS)]
    header = ["Date", "Time", "PV", "Date", "Time", "OP"]
    check_shifted(one(write(tmp_path / "a.csv", text(rows, header))), late=1)


def test_one_time_that_is_named_counts_for_all(tmp_path: Path) -> None:
    header = ["T1", "F.PV", "T2", "F.OP", "T3", "F.SP"]
    loop = one(write(tmp_path / "a.csv", shifted(header)), columns=CsvColumns(time="T1"))
    assert loop.parts[0].op[0, 0] == op(10)
    assert "all times are those of T1, not F.PV in column 1 T1, F.OP in column 3 T2" in said(loop)


def test_a_header_that_returns_in_another_order(tmp_path: Path) -> None:
    first = text(table()[:70])
    later = text([[t, y, s, u] for t, u, y, s in table()[70:]], ["time", "PV", "SP", "OP"])
    loop = one(write(tmp_path / "a.csv", first + later))
    check(loop)
    assert "the header of line 72 has other columns or another order" in said(loop)
    assert "the header of line 72" in str(one(tmp_path / "a.csv", strict=True).problem)


def test_a_header_that_returns_with_other_columns(tmp_path: Path) -> None:
    later = text([["7", t, u, y] for t, u, y, _ in table()[70:]], ["TI9", "time", "OP", "PV"])
    loop = one(write(tmp_path / "a.csv", text(table()[:70]) + later))
    assert loop.problem is None
    np.testing.assert_allclose(loop.parts[0].op[:, 0], [op(k) for k in range(ROWS)])
    assert "read by its names, without SP; TI9 is left out" in said(loop)


def test_a_header_that_returns_as_it_was(tmp_path: Path) -> None:
    parts = [text(table()[k : k + 40]) for k in (0, 40, 80)]
    loop = one(write(tmp_path / "a.csv", "\ufeff".join(parts)))
    check(loop)
    assert loop.notes == ("the header stands again at line 42 and 1 times more, left out",)


def test_white_space_between_the_cells(tmp_path: Path) -> None:
    rows = [f"   {STEP * k:.1f}   {op(k):e}  {pv(k):e}\n" for k in range(ROWS)]
    path = write(tmp_path / "a.dat", "  t  OP PV\n" + "".join(rows))
    loop = one(path)
    np.testing.assert_allclose(loop.parts[0].pv[:, 0], [pv(k) for k in range(ROWS)])
    stamped = "".join(f"{iso(k)}   {op(k)} {pv(k)}\n" for k in range(ROWS))
    check(one(write(tmp_path / "b.txt", "Date Time OP PV\n" + stamped)))


def test_rows_a_sample_time_apart(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", text([row[1:] for row in table()], HEADER[1:]))
    assert "--sample-time S say that its rows are S seconds apart" in str(one(path).problem)
    loop = one(path, sample_time=10.0)
    check(loop)
    assert loop.notes == ("no column holds a time: rows are taken 10 s apart",)


def workbook(path: Path, *, formulas: bool = False) -> Path:
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(HEADER)
    for k in range(ROWS):
        sheet.append([iso(k), f"={op(k)}*1" if formulas else op(k), pv(k), 200.0])
    book.save(path)
    return path


@pytest.mark.parametrize("name", ["a.csv", "a.xls", "a.zip"])
def test_a_workbook_by_any_name(tmp_path: Path, name: str) -> None:
    check(one(workbook(tmp_path / "a.xlsx").rename(tmp_path / name)))


def test_formulas_without_their_values(tmp_path: Path) -> None:
    found = str(one(workbook(tmp_path / "a.xlsx", formulas=True)).problem)
    assert "cell B2 of Sheet is a formula without its value" in found


def test_an_archive_of_tables(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.csv", "w") as archive:
        archive.writestr("b.csv", text(table()))
    assert "is a zip archive; unpack it" in str(one(tmp_path / "a.csv").problem)


def test_a_unit_of_stamps_is_no_other_shape(tmp_path: Path) -> None:
    """A table with a word a row and two numbers is not taken for one value a row."""
    rows = [[styled("%d.%m.%Y %H:%M:%S")(k), "A1", u, y] for k, (_, u, y, _) in enumerate(table())]
    path = write(tmp_path / "a.csv", text(rows, ["Zeitpunkt", "Sorte", "Klappe", "Menge"]))
    assert "--op TAG=COLUMN --pv TAG=COLUMN" in str(one(path).problem)
    columns = CsvColumns(op={"V": "Klappe"}, pv={"P": "Menge"})
    check(one(path, columns=columns))


@pytest.mark.parametrize("header", [["Timestamp", "{}", "State"], ["time", "value", "Source"]])
def test_a_file_for_each_tag_with_words_beside_is_no_long_table(
    tmp_path: Path, header: list[str]
) -> None:
    for name, value in (("PV", pv), ("OP", op), ("SP", lambda k: 200.0)):
        rows = [[iso(k), str(value(k)), "a" if k % 3 else "b"] for k in range(ROWS)]
        given = [word.format(f"F.{name}") for word in header]
        write(tmp_path / f"F.{name}.csv", text(rows, given))
    check(one(tmp_path))


def test_a_long_table_of_strange_tags_is_told_beside_others(tmp_path: Path) -> None:
    header = ["A", "B", "C"]
    write(tmp_path / "a.csv", text(long(), header))
    write(tmp_path / "b.csv", text([["TT" + row[0][-2:], *row[1:]] for row in long()], header))
    first, second = sorted(read(tmp_path), key=lambda loop: loop.name)
    check(first)
    assert "has no tag such as FIC101.PV or FIC101/OP in column A" in str(second.problem)


def test_tags_above_columns_that_are_all_called_value(tmp_path: Path) -> None:
    tags = "F.PV,,F.OP,,F.SP\n"
    rows = shifted(["Timestamp", "Value", "Timestamp", "Value", "Timestamp", "Value"])
    loop = one(write(tmp_path / "a.csv", tags + rows))
    check_shifted(loop)
    assert {said.split(" from ")[1].split(":")[0] for said in loop.signals} == {
        "F.PV",
        "F.OP",
        "F.SP",
    }


def test_one_value_a_row_with_date_and_time_of_day(tmp_path: Path) -> None:
    rows = [[tag, *stamp.split(), value] for tag, stamp, value in long()]
    loop = one(write(tmp_path / "a.csv", text(rows, ["Tag", "Date", "Time", "Result"])))
    check(loop)
    assert "2024-10-17" in loop.summary


def test_one_value_a_row_with_times_as_numbers(tmp_path: Path) -> None:
    rows = [[tag, str(10 * (k // 3)), value] for k, (tag, _, value) in enumerate(long())]
    check(one(write(tmp_path / "a.csv", text(rows, ["point", "t", "v"]))))
