"""Rows keep their values together in every form of a table; what stands twice is counted."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import HEADER, ROWS, STEP, iso, one, op, pv, read, said, text, write

from stiction_ros.errors import InputError
from stiction_ros.intake import IntakeOptions, Loop
from stiction_ros.intake.intake import one_loop


def rows_of(loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    assert loop.problem is None
    (record,) = loop.parts
    return record.op[:, 0], record.pv[:, 0]


def check_rows(loop: Loop, count: int, scan: float) -> None:
    found = rows_of(loop)
    np.testing.assert_allclose(found[0], [op(k) for k in range(count)])
    np.testing.assert_allclose(found[1], [pv(k) for k in range(count)])
    assert loop.parts[0].sample_time == pytest.approx(scan, rel=2e-3)


@pytest.mark.parametrize(
    ("scan", "digits", "stamp"),
    [(0.7, 0, "rows on each"), (0.3, 0, "rows on each"), (1.1, 0, "rounded"), (0.0125, 2, "rou")],
)
def test_stamps_with_fewer_digits_than_the_scan(
    tmp_path: Path, scan: float, digits: int, stamp: str
) -> None:
    count = 700
    rows = [
        [f"{int(scan * k * 10**digits + 1e-9) / 10**digits:.{digits}f}", str(op(k)), str(pv(k))]
        for k in range(count)
    ]
    loop = one(write(tmp_path / "loop.csv", text(rows, ["t", "OP", "PV"])))
    check_rows(loop, count, scan)
    assert stamp in said(loop)


def test_one_value_a_row_on_whole_seconds(tmp_path: Path) -> None:
    count = 700
    rows = [
        [f"F1.{signal}", str(int(0.7 * k + 1e-9)), str(of(k))]
        for k in range(count)
        for signal, of in (("OP", op), ("PV", pv))
    ]
    loop = one(write(tmp_path / "tall.csv", text(rows, ["Tag", "t", "Value"])))
    check_rows(loop, count, 0.7)


TWICE = (20, 47, 90)


def tall(signal: str) -> list[list[str]]:
    of = {"OP": op, "PV": pv}[signal]
    rows = [[f"F1.{signal}", iso(k), str(of(k))] for k in range(ROWS)]
    for k in reversed(TWICE):
        rows.insert(k, [f"F1.{signal}", iso(k), str(of(k) + 5.0)])
    return rows


NOTE = "3 rows with the time stamp of an earlier row: the last value counts, 3 differ"


def test_two_values_on_a_stamp_are_counted_with_one_value_a_row(tmp_path: Path) -> None:
    loop = one(write(tmp_path / "t.csv", text(tall("OP") + tall("PV"), ["Tag", "time", "Value"])))
    check_rows(loop, ROWS, STEP)
    assert f"F1.OP: {NOTE}" in said(loop)
    assert f"F1.PV: {NOTE}" in said(loop)


def test_two_values_on_a_stamp_are_counted_with_a_file_a_tag(tmp_path: Path) -> None:
    for signal in ("OP", "PV"):
        rows = [row[1:] for row in tall(signal)]
        write(tmp_path / f"F1.{signal}.csv", text(rows, ["time", f"F1.{signal}"]))
    (loop,) = read(tmp_path)
    check_rows(loop, ROWS, STEP)
    assert f"F1.PV: {NOTE}" in said(loop)


def test_newest_first_the_last_in_time_counts(tmp_path: Path) -> None:
    rows = tall("OP") + tall("PV")
    path = write(tmp_path / "t.csv", text(rows[::-1], ["Tag", "time", "Value"]))
    check_rows(one(path), ROWS, STEP)


def test_files_that_overlap_and_differ_are_counted(tmp_path: Path) -> None:
    header = ["time", "F1.OP", "F1.PV"]
    rows = [[iso(k), str(op(k)), str(pv(k))] for k in range(ROWS)]
    other = [[iso(k), str(op(k) + 5.0), str(pv(k))] for k in range(60, 70)]
    write(tmp_path / "a.csv", text(rows[:60] + other, header))
    write(tmp_path / "b.csv", text(rows[60:], header))
    (loop,) = read(tmp_path)
    check_rows(loop, ROWS, STEP)
    assert "F1.OP: 10 values at a stamp that another table has differ: the later table counts" in (
        loop.notes
    )
    assert "F1.PV" not in said(loop)


def test_strict_refuses_two_values_on_a_stamp(tmp_path: Path) -> None:
    path = write(tmp_path / "t.csv", text(tall("OP") + tall("PV"), ["Tag", "time", "Value"]))
    with pytest.raises(InputError, match=r"sort the rows and remove those that are there twice"):
        one_loop(path, IntakeOptions(strict=True))
    single = {row[0] + row[1]: row for row in tall("OP") + tall("PV")}
    mended = text(list(single.values()), ["Tag", "time", "Value"])
    check_rows(one(write(path, mended), strict=True), ROWS, STEP)


def test_the_hour_that_comes_twice_with_one_value_a_row(tmp_path: Path) -> None:
    count, hour = 900, 360
    rows = [
        [f"F1.{signal}", iso(k if k < 500 else k - hour), str(of(k))]
        for signal, of in (("OP", op), ("PV", pv))
        for k in range(count)
    ]
    loop = one(write(tmp_path / "t.csv", text(rows, ["Tag", "time", "Value"])))
    check_rows(loop, count, STEP)
    assert "the clock is set back by an hour" in said(loop)


def test_an_empty_cell_of_a_later_table_hides_no_value(tmp_path: Path) -> None:
    header = ["time", "F1.OP", "F1.PV"]
    rows = [[iso(k), str(op(k)), str(pv(k))] for k in range(ROWS)]
    write(tmp_path / "a.csv", text(rows, header))
    write(
        tmp_path / "b.csv",
        text([[iso(k), str(op(k)) if k % 2 else "", str(pv(k))] for k in range(ROWS)], header),
    )
    (loop,) = read(tmp_path)
    check_rows(loop, ROWS, STEP)


@pytest.mark.parametrize("wanted", [None, 5.0])
def test_rows_of_a_wide_table_that_jitter(tmp_path: Path, wanted: float | None) -> None:
    random = np.random.default_rng(2)
    times = 5.0 * (np.arange(ROWS) + random.uniform(-0.25, 0.25, ROWS))
    rows = [[f"{t:.3f}", str(op(k)), str(pv(k)), "200"] for k, t in enumerate(times)]
    loop = one(write(tmp_path / "loop.csv", text(rows, HEADER)), sample_time=wanted)
    check_rows(loop, ROWS, 5.0)
    assert "sample times jitter by up to" in said(loop)


@pytest.mark.parametrize("jitter", [0.0, 0.1])
def test_tags_on_clocks_of_their_own(tmp_path: Path, jitter: float) -> None:
    random = np.random.default_rng(5)
    rows = []
    for signal, of, late in (("OP", op, 0.3), ("PV", pv, 0.7)):
        times = STEP * (np.arange(300) + late + random.uniform(-jitter, jitter, 300))
        rows += [[f"F1.{signal}", f"{t:.3f}", str(of(k))] for k, t in enumerate(times)]
    loop = one(write(tmp_path / "tall.csv", text(rows, ["Tag", "t", "Value"])))
    check_rows(loop, 300, STEP)
    assert "OP and PV have stamps of their own: taken at the 300 of PV" in said(loop)
    assert loop.parts[0].mask is None


def test_signals_kept_when_they_changed_are_still_brought_onto_a_grid(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    rows = [
        [f"F1.{signal}", iso(k), str(of(k))]
        for signal, of in (("OP", op), ("PV", pv))
        for k in np.flatnonzero(random.random(400) < 0.3).tolist()
    ]
    loop = one(write(tmp_path / "tall.csv", text(rows, ["Tag", "time", "Value"])))
    assert "reports when values changed" in said(loop)
