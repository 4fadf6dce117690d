"""Every export that is usual is read right, or refused with the option that helps."""

import csv
import gzip
import io
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import zstandard

sys.path.insert(0, str(Path(__file__).parent))
from exports import (
    BEGIN,
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

from stiction_ros.intake.intake_options import OpUnit, TimeUnit
from stiction_ros.intake.sheets.stamps import DateOrder
from stiction_ros.records.record import Quality


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_encodings(tmp_path: Path, encoding: str) -> None:
    header = ["time", "OP", "PV", "SP", "Gerät"]
    rows = [[*row, "Ä"] for row in table()]
    check(one(write(tmp_path / "a.csv", text(rows, header), encoding)))


@pytest.mark.parametrize("pack", ["gz", "zst"])
def test_packed_text(tmp_path: Path, pack: str) -> None:
    data = text(table()).encode()
    packed = gzip.compress(data) if pack == "gz" else zstandard.ZstdCompressor().compress(data)
    path = tmp_path / f"FIC1.csv.{pack}"
    path.write_bytes(packed)
    loop = one(path)
    check(loop)
    assert loop.name == "FIC1"
    path.write_bytes(packed[: len(packed) // 2])
    assert "cut off or damaged" in str(one(path).problem)


@pytest.mark.parametrize(
    ("form", "word"),
    [
        ("%m/%d/%Y %I:%M:%S %p", "month first"),
        ("%d/%m/%Y %H:%M:%S", "day first"),
        ("%d.%m.%Y %H:%M:%S", ""),
        ("%d-%b-%y %H:%M:%S", ""),
        ("%d-%b-%Y %H:%M:%S.000", ""),
        ("%Y/%m/%d %H:%M:%S", ""),
        ("%Y%m%d%H%M%S", ""),
        ("%Y%m%dT%H%M%S", ""),
        ("%Y-%m-%dT%H:%M:%SZ", ""),
        ("%Y-%m-%dT%H:%M:%S+02:00", ""),
    ],
)
def test_dates(tmp_path: Path, form: str, word: str) -> None:
    loop = one(write(tmp_path / "a.csv", text(table(styled(form)))))
    check(loop)
    shift = 7200.0 if "+02" in form else 0.0
    assert loop.parts[0].start == BEGIN.timestamp() - shift
    assert word in said(loop)


def test_dates_that_may_be_either_are_asked_for(tmp_path: Path) -> None:
    rows = [[f"01/02/2024 12:{k // 6:02d}:{k % 6}0", *row[1:]] for k, row in enumerate(table())]
    path = write(tmp_path / "a.csv", text(rows))
    assert "say which with --dates dmy or --dates mdy" in str(one(path).problem)
    for order, month in ((DateOrder.DAY, "2024-02-01"), (DateOrder.MONTH, "2024-01-02")):
        loop = one(path, dates=order)
        check(loop)
        assert month in loop.summary


def test_the_order_of_dates_is_told_by_a_midnight(tmp_path: Path) -> None:
    def stamp(k: int) -> str:
        return f"{'02' if k < 60 else '03'}/04/2024 {'23' if k < 60 else '00'}:{k % 60:02d}:00"

    rows = [[stamp(k), *row[1:]] for k, row in enumerate(table())]
    loop = one(write(tmp_path / "a.csv", text(rows)))
    assert loop.problem is None
    assert loop.parts[0].sample_time == 60.0
    assert "dates are read with the day first" in loop.notes


@pytest.mark.parametrize("mark", [";", "\t"])
def test_decimal_commas_and_thousands(tmp_path: Path, mark: str) -> None:
    rows = [[t, *(value.replace(".", ",") for value in row)] for t, *row in table()]
    check(one(write(tmp_path / "a.csv", text(rows, mark=mark))))
    out = io.StringIO()
    csv.writer(out).writerows([HEADER, *rows])  # quoted
    check(one(write(tmp_path / "b.csv", out.getvalue())))
    rows = [[t, u, f"1,{y.rjust(3, '0')}" if "." in y else y, s] for t, u, y, s in table()]
    out = io.StringIO()
    csv.writer(out).writerows([HEADER, *rows])
    loop = one(write(tmp_path / "c.csv", out.getvalue()))
    np.testing.assert_allclose(loop.parts[0].pv[:, 0], [1000.0 + pv(k) for k in range(ROWS)])


def test_decimal_commas_between_commas_are_refused(tmp_path: Path) -> None:
    rows = [[t, *(value.replace(".", ",") for value in row)] for t, *row in table()]
    said = str(one(write(tmp_path / "a.csv", text(rows))).problem)
    assert "decimal commas need semicolons or tabs" in said


def test_title_and_unit_rows(tmp_path: Path) -> None:
    top = "Trend of unit 3\n\nfrom,17.10.2024\n"
    body = text([["", "%", "m3/h", "m3/h"], *table()])
    check(one(write(tmp_path / "a.csv", top + body)))
    loop = one(write(tmp_path / "b.csv", "sep=;\n" + text(table(), mark=";")))
    check(loop)


@pytest.mark.parametrize("by", ["header", "row", "option"])
def test_a_share_of_travel_becomes_percent(tmp_path: Path, by: str) -> None:
    rows = [[t, str(float(u) / 100.0), *rest] for t, u, *rest in table()]
    header = ["time", "OP [0-1]" if by == "header" else "OP", "PV", "SP"]
    units = [["", "0-1", "t/h", "t/h"]] if by == "row" else []
    path = write(tmp_path / "a.csv", text([*units, *rows], header))
    loop = one(path, op_unit=OpUnit.SHARE if by == "option" else None)
    check(loop)
    assert "OP of 0 to 1 brought to %" in loop.notes
    assert loop.op_unit == "%"


def test_an_op_between_0_and_1_is_asked_for(tmp_path: Path) -> None:
    rows = [[t, str(float(u) / 100.0), *rest] for t, u, *rest in table()]
    path = write(tmp_path / "a.csv", text(rows))
    assert "--op-unit share or --op-unit percent" in str(one(path).problem)
    kept = one(path, op_unit=OpUnit.PERCENT)
    assert kept.parts[0].op.max() < 1.0
    centred = [[t, str(float(u) / 100.0 - 0.5), *rest] for t, u, *rest in table()]
    loop = one(write(tmp_path / "b.csv", text(centred)))
    assert "perhaps without its mean" in said(loop)
    assert loop.op_unit == "its own unit"


def test_a_current_becomes_percent(tmp_path: Path) -> None:
    rows = [[t, str(4.0 + 0.16 * float(u)), *rest] for t, u, *rest in table()]
    path = write(tmp_path / "a.csv", text(rows, ["time", "OP (mA)", "PV", "SP"]))
    check(one(path))


@pytest.mark.parametrize(
    ("name", "factor", "offset", "unit"),
    [
        ("time", 1e3, 1.7292e12, None),
        ("time", 1e6, 1.7292e15, None),
        ("t_ms", 1e3, 0.0, None),
        ("t [ms]", 1e3, 0.0, None),
        ("t", 1e3, 0.0, TimeUnit.MILLISECONDS),
        ("t (min)", 1.0 / 60.0, 0.0, None),
        ("time", 1.0 / 86400.0, 45582.5, None),
    ],
)
def test_times_in_other_units(
    tmp_path: Path, name: str, factor: float, offset: float, unit: TimeUnit | None
) -> None:
    rows = [[repr(offset + factor * STEP * k), *row[1:]] for k, row in enumerate(table())]
    path = write(tmp_path / "a.csv", text(rows, [name, "OP", "PV", "SP"]))
    loop = one(path, time_unit=unit)
    check(loop)
    assert "2024" in loop.summary or offset == 0.0


def test_times_that_may_be_milliseconds_are_asked_for(tmp_path: Path) -> None:
    rows = [[str(1000 * k), *row[1:]] for k, row in enumerate(table())]
    path = write(tmp_path / "a.csv", text(rows, ["t", "OP", "PV", "SP"]))
    assert "--time-unit ms or --time-unit s" in str(one(path).problem)
    assert one(path, time_unit=TimeUnit.MILLISECONDS).parts[0].sample_time == 1.0
    assert "one each 1000 s" in one(path, time_unit=TimeUnit.SECONDS).summary


@pytest.mark.parametrize(
    "words", [("AUTO", "MAN"), ("CAS", "TRK"), ("Automatic", "Manual"), ("1", "0"), ("16", "8")]
)
def test_manual_stretches_are_cut_by_mode(tmp_path: Path, words: tuple[str, str]) -> None:
    rows = [
        [t, "33.0" if 40 <= k < 60 else u, *rest, words[40 <= k < 60]]
        for k, (t, u, *rest) in enumerate(table())
    ]
    loop = one(write(tmp_path / "a.csv", text(rows, [*HEADER, "MODE"])))
    assert loop.problem is None
    (record,) = loop.parts
    assert record.usable_rows() == [(0, 40), (60, ROWS)]
    assert set(record.quality[40:60].tolist()) == {Quality.MANUAL}
    assert f"20 samples not in automatic ({words[1]}), cut out" in loop.notes


def test_a_mode_without_a_tag_is_that_of_the_one_loop(tmp_path: Path) -> None:
    rows = [[*row, "MAN" if 40 <= k < 60 else "AUTO"] for k, row in enumerate(table())]
    header = ["time", "FIC1.OP", "FIC1.PV", "SP", "MODE"]
    (record,) = one(write(tmp_path / "a.csv", text(rows, header))).parts
    assert record.usable_rows() == [(0, 40), (60, ROWS)]
    assert record.sp is not None
    two = [[*row[:3], *row[1:3], row[4]] for row in rows]
    header = ["time", "FIC1.OP", "FIC1.PV", "FIC2.OP", "FIC2.PV", "MODE"]
    found = read(write(tmp_path / "b.csv", text(two, header)))
    assert [loop.name for loop in found] == ["FIC1", "FIC2"]
    for loop in found:
        assert "MODE is left out: it names none of the 2 loops" in loop.notes


def test_a_mode_that_nobody_knows_is_asked_for(tmp_path: Path) -> None:
    rows = [[*row, "P1" if k < 40 else "Q1"] for k, row in enumerate(table())]
    path = write(tmp_path / "a.csv", text(rows, [*HEADER, "MODE"]))
    assert "say which with --auto" in str(one(path).problem)
    loop = one(path, automatic=("q1",))
    assert loop.parts[0].usable_rows() == [(40, ROWS)]


@pytest.mark.parametrize("value", ["-9999", "1e30", "-32768"])
def test_a_sentinel_is_held_and_told(tmp_path: Path, value: str) -> None:
    rows = table()
    rows[50][2] = value
    loop = one(write(tmp_path / "a.csv", text(rows)))
    (record,) = loop.parts
    assert record.quality[50] == Quality.HELD
    assert abs(record.pv[50, 0] - pv(50)) < 2.0
    assert "1 value such as" in said(loop)


def test_a_sentinel_among_few_good_values_is_one(tmp_path: Path) -> None:
    rows = table()
    for row in rows[9:-1]:
        row[2] = "Bad"
    rows[-1][2] = "-9999"
    loop = one(write(tmp_path / "a.csv", text(rows)))
    assert "1 value such as -9999" in said(loop)


def test_a_value_that_may_be_meant_is_kept(tmp_path: Path) -> None:
    rows = table()
    rows[50][2] = "212.0"  # a spike that a loop may have
    loop = one(write(tmp_path / "a.csv", text(rows)))
    assert loop.parts[0].pv[50, 0] == 212.0
    assert loop.notes == ()


@pytest.mark.parametrize("word", ["Bad", "I/O Timeout", "", "#N/A", "nan", "---"])
def test_bad_values_are_held_or_cut_and_counted(tmp_path: Path, word: str) -> None:
    rows = table()
    for k in (20, 21, *range(70, 80)):
        rows[k][2] = word
    path = write(tmp_path / "a.csv", text(rows))
    loop = one(path)
    (record,) = loop.parts
    assert set(record.quality[[20, 21]].tolist()) == {Quality.HELD}
    assert record.usable_rows() == [(0, 70), (80, ROWS)]
    assert "PV: 12 values of 120 missing" in said(loop)
    assert "2 samples held" in said(loop)
    assert "10 samples bad, cut out" in said(loop)
    strict = one(path, strict=True)
    assert "first: line 22" in str(strict.problem)


def test_a_column_of_qualities(tmp_path: Path) -> None:
    for words in (("Good", "Bad"), ("192", "0")):
        rows = [[*row, words[k in (30, 31)]] for k, row in enumerate(table())]
        loop = one(write(tmp_path / "a.csv", text(rows, [*HEADER, "Status"])))
        assert set(loop.parts[0].quality[[30, 31]].tolist()) == {Quality.HELD}


def test_stamps_that_are_there_twice(tmp_path: Path) -> None:
    rows = table()
    rows.insert(31, [rows[30][0], rows[30][1], "205.5", rows[30][3]])
    path = write(tmp_path / "a.csv", text(rows))
    loop = one(path)
    (record,) = loop.parts
    assert len(record) == ROWS
    assert record.pv[30, 0] == 205.5
    assert "time stamp of an earlier row: the last value counts, 1 differ" in said(loop)
    assert "time does not increase at line 33" in str(one(path, strict=True).problem)


def test_rows_that_stand_the_wrong_way(tmp_path: Path) -> None:
    loop = one(write(tmp_path / "a.csv", text(table()[::-1])))
    check(loop)
    assert "rows stood from the last to the first and are turned" in loop.notes
    for rows in (table(), [[str(k), *row[1:]] for k, row in enumerate(table())]):
        rows[40], rows[41] = rows[41], rows[40]
        loop = one(write(tmp_path / "b.csv", text(rows)))
        assert loop.parts[0].op[:, 0].tolist() == [float(row[1]) for row in table()]
        assert loop.notes == ("1 row out of order sorted",)


def test_a_clock_that_is_set_back(tmp_path: Path) -> None:
    def stamp(k: int) -> str:
        minute = 30 + k if k < 90 else k - 30  # 03:00 becomes 02:00
        return f"2024-10-27 {1 + minute // 60:02d}:{minute % 60:02d}:00"

    loop = one(write(tmp_path / "a.csv", text(table(stamp))))
    (record,) = loop.parts
    assert (len(record), record.sample_time) == (ROWS, 60.0)
    assert "the clock is set back by an hour" in said(loop)


def test_two_runs_of_a_clock(tmp_path: Path) -> None:
    rows = [[str(k % 60), *row[1:]] for k, row in enumerate(table())]
    loop = one(write(tmp_path / "a.csv", text(rows, ["t", "OP", "PV", "SP"])))
    assert [len(part) for part in loop.parts] == [60, 60]
    assert "time begins anew: 2 runs" in loop.notes


def test_raw_stamps_are_brought_to_the_scan_and_what_is_lost_is_said(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    lines = ["tag,time,value"]
    for name, value, share in (("OP", op, 0.4), ("PV", pv, 0.6)):
        kept = [k for k in range(600) if k in (0, 599) or rng.random() < share]
        lines += [f"FIC7.{name},{iso(k)},{value(k)}" for k in kept]
    path = write(tmp_path / "a.csv", "\n".join(lines))
    loop = one(path)
    (record,) = loop.parts
    assert (record.sample_time, len(record)) == (STEP, 600)
    given = {op(k) for k in range(600)}
    assert set(np.round(record.op[:, 0], 4).tolist()) <= given  # held
    assert "lost is what moved less than was reported" in said(loop)
    assert set(record.quality.tolist()) == {Quality.GOOD, Quality.HELD}
    coarse = one(path, sample_time=30.0)
    assert coarse.parts[0].sample_time == 30.0
    assert "leave --strict out" in str(one(path, strict=True).problem)


@pytest.mark.parametrize("step", [0.1, 2.0])
def test_op_and_pv_swapped_without_set_point(tmp_path: Path, step: float) -> None:
    """Rounding to 2 % hides the controller's law from sample to sample, not over eight of them."""
    rng = np.random.default_rng(2)
    y, u, before, lines = 0.0, 50.0, 0.0, ["t,OP,PV"]
    for k in range(600):
        y = 0.8 * y + 0.2 * (u - 50.0) + 2.0 * rng.standard_normal()
        u += -0.5 * (y - before) - 0.3 * y
        before = y
        lines.append(f"{k},{y + 20.0:.3f},{step * round(u / step):g}")  # the wrong way round
    path = write(tmp_path / "a.csv", "\n".join(lines))
    assert "--op V1=PV --pv PV1=OP" in str(one(path).problem)
    right = write(tmp_path / "b.csv", "\n".join(lines).replace("OP,PV", "PV,OP"))
    assert one(right).problem is None


def wide(tags: tuple[str, ...] = ("FIC1", "FIC2"), mark: str = ".") -> str:
    header = ["Timestamp", *(f"{tag}{mark}{name}" for tag in tags for name in ("PV", "SP", "OP"))]
    rows = [[t, *([y, s, u] * len(tags))] for t, u, y, s in table()]
    return text(rows, header)


@pytest.mark.parametrize("mark", [".", "/", "_", " ", ".PIDA.", "/PID1/"])
def test_loops_side_by_side(tmp_path: Path, mark: str) -> None:
    found = read(write(tmp_path / "a.csv", wide(mark=mark)))
    assert [loop.name for loop in found] == ["FIC1", "FIC2"]
    for loop in found:
        check(loop)
        assert loop.parts[0].valves == loop.parts[0].outputs == (loop.name,)


def test_an_indicator_is_told_and_stops_no_loop(tmp_path: Path) -> None:
    lines = wide().splitlines()
    lines = [f"{line},{'TI9.PV' if k == 0 else k}" for k, line in enumerate(lines)]
    found = read(write(tmp_path / "a.csv", "\n".join(lines)))
    assert [loop.problem is None for loop in found] == [True, True, False]
    assert "loop TI9 has no OP, only TI9.PV" in str(found[2].problem)


def test_one_value_a_row_with_qualities(tmp_path: Path) -> None:
    rows = []
    for k in range(ROWS):
        for name, value in (("PV", pv(k)), ("OP", op(k)), ("SP", 200.0)):
            bad = name == "PV" and k in (30, 31)
            rows.append([f"LIC5.{name}", iso(k), str(value), "Bad" if bad else "Good"])
    path = write(tmp_path / "a.csv", text(rows, ["TagName", "DateTime", "Value", "Quality"]))
    loop = one(path)
    (record,) = loop.parts
    assert (loop.name, len(record), record.sample_time) == ("LIC5", ROWS, STEP)
    assert set(record.quality[[30, 31]].tolist()) == {Quality.HELD}
    assert record.op[50, 0] == op(50)


def test_a_file_for_each_tag_and_for_each_day(tmp_path: Path) -> None:
    for name, column in (("PV", 2), ("OP", 1), ("SP", 3)):
        for day, rows in enumerate((table()[:60], table()[60:])):
            lines = [[row[0], row[column]] for row in rows]
            header = ["Timestamp", f"FIC3.{name}"]
            write(tmp_path / f"FIC3_{name}_{day}.csv", text(lines, header))
    loop = one(tmp_path)
    check(loop)
    assert len(loop.files) == 6
    for name in ("PV", "OP"):
        lines = [[row[0], row[HEADER.index(name)]] for row in table()]
        write(tmp_path / "other" / f"FIC4.{name}.csv", text(lines, ["time", "value"]))
    check(one(tmp_path / "other"))


def test_a_tag_list_says_which_tags_belong_together(tmp_path: Path) -> None:
    header = ["time", "FT101", "FC101_SET", "FY101", "TI7"]
    rows = [[t, y, s, str(float(u) / 100.0), "3"] for t, u, y, s in table()]
    write(tmp_path / "plant" / "a.csv", text(rows, header))
    for content in (
        "loop,pv,sp,op,op_unit\nFIC101,FT101,FC101_SET,FY101,share\n",
        "tag,loop,signal,op_unit\nFT101,FIC101,PV,\nFC101_SET,FIC101,SP,\nFY101,FIC101,OP,share\n",
    ):
        tags = write(tmp_path / "plant" / "tags.csv", content)
        loop = one(tmp_path / "plant", tags=tags)
        check(loop)
        assert loop.name == "FIC101"
        assert any(said.startswith("OP FIC101 from FY101: ") for said in loop.signals)


def test_parquet(tmp_path: Path) -> None:
    import pyarrow as arrow
    import pyarrow.parquet as parquet

    times = np.array([np.datetime64(iso(k).replace(" ", "T"), "ms") for k in range(ROWS)])
    rows = range(ROWS)
    values: list[float | None] = [pv(k) for k in rows]
    data = {"time": times, "OP": [op(k) for k in rows], "PV": values, "SP": [200.0] * ROWS}
    parquet.write_table(arrow.table(data), tmp_path / "a.parquet")
    check(one(tmp_path / "a.parquet"))
    values[20] = None
    parquet.write_table(arrow.table(data), tmp_path / "a.parquet")
    assert one(tmp_path / "a.parquet").parts[0].quality[20] == Quality.HELD
    long = {"tag": ["F1.OP"] * ROWS + ["F1.PV"] * ROWS, "time": [*times, *times]}
    long["value"] = [op(k) for k in rows] + [pv(k) for k in rows]
    parquet.write_table(arrow.table(long), tmp_path / "b.parquet")
    check(one(tmp_path / "b.parquet"))
    (tmp_path / "c.parquet").write_bytes(b"PAR1 and nothing else")
    assert "cannot be read" in str(one(tmp_path / "c.parquet").problem)


@pytest.mark.parametrize("dated", [True, False])
def test_workbook(tmp_path: Path, dated: bool) -> None:
    import openpyxl

    book = openpyxl.Workbook(write_only=True)
    for tag in ("FIC1", "FIC2"):
        sheet = book.create_sheet(tag)
        sheet.append(["Trend"])
        sheet.append(["Time", *(f"{tag}.{name}" for name in ("OP", "PV"))])
        for k in range(ROWS):
            naive = BEGIN.replace(tzinfo=None) + (k * STEP) * np.timedelta64(1, "s").astype(object)
            sheet.append([naive if dated else iso(k), op(k), pv(k)])
    book.create_sheet("notes").append(["nothing"])
    book.save(tmp_path / "a.xlsx")
    found = [loop for loop in read(tmp_path / "a.xlsx") if loop.problem is None]
    assert [loop.name for loop in found] == ["FIC1", "FIC2"]
    for loop in found:
        check(loop)


def test_a_folder_of_everything_keeps_going(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", text(table()))
    write(tmp_path / "b.csv", "nothing")
    write(tmp_path / "deeper" / "c.csv", text(table()))
    write(tmp_path / "readme.md", "# not a loop")
    (tmp_path / "d.csv").write_bytes(bytes(range(4)) * 5)
    (tmp_path / "e.csv.gz").write_bytes(b"PK\x03\x04 a zip")
    found = {loop.name: loop.problem for loop in read(tmp_path)}
    assert [name for name, problem in found.items() if problem is None] == ["a", "c"]
    assert "is no text" in str(found["d"])
    assert "unpack it" in str(found["e"])


def test_gaps_make_parts(tmp_path: Path) -> None:
    rows = table()[:50] + table()[80:]
    loop = one(write(tmp_path / "a.csv", text(rows)))
    assert [len(part) for part in loop.parts] == [50, 40]
    assert "split at 1 gap" in loop.notes


def peak_memory(path: Path, rows: int) -> int:
    """Bytes that reading a file of so many rows takes at most."""
    with path.open("w") as file:
        file.write("t,OP,PV,SP,MODE,comment\n")
        file.writelines(
            f"{k},{50 + k % 7}.25,{200 + k % 11}.125,200,AUTO,nobody needs this column\n"
            for k in range(rows)
        )
    tracemalloc.start()
    try:
        loop = one(path)
        assert [len(part) for part in loop.parts] == [rows]
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.trial
def test_memory_grows_with_the_numbers_and_not_with_the_text(tmp_path: Path) -> None:
    few, many = (peak_memory(tmp_path / "long.csv", rows) for rows in (50_000, 110_000))
    # Four columns and their copies; the cells as text would take 400 bytes a row and more.
    assert (many - few) / 60_000 < 200
