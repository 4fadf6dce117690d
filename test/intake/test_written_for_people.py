"""Exports that are written for people: units in cells, typeset signs, stamps without seconds."""

import datetime
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import BEGIN, HEADER, ROWS, STEP, check, one, op, pv, said, table, text, write

from stiction_ros.records.record import Quality


@pytest.mark.parametrize("units", [(" %", " t/h"), ("%", " bar"), (" %", " °C"), ("%", "°C")])
def test_units_behind_the_values(tmp_path: Path, units: tuple[str, str]) -> None:
    of_op, of_pv = units
    rows = [[t, op + of_op, pv + of_pv, sp + of_pv] for t, op, pv, sp in table()]
    check(one(write(tmp_path / "a.csv", text(rows))))


def test_a_quality_behind_a_value_is_no_unit(tmp_path: Path) -> None:
    rows = [list(row) for row in table()]
    rows[30][2] += " Bad"
    assert "1 value of" in said(one(write(tmp_path / "a.csv", text(rows))))


@pytest.mark.parametrize("space", ["\u00a0", "\u202f", "'"])
def test_thousands_and_minus_as_typeset(tmp_path: Path, space: str) -> None:
    rows = [
        [t, f"{float(op) - 90.0:.6f}".replace("-", "\u2212"), f"1{space}{float(pv):.6f}", ""]
        for t, op, pv, _ in table()
    ]
    part = one(write(tmp_path / "a.csv", text(rows))).parts[0]
    assert part.op[:, 0] == pytest.approx([op(k) - 90.0 for k in range(ROWS)], abs=1e-4)
    assert part.pv[:, 0] == pytest.approx([1000.0 + pv(k) for k in range(ROWS)], abs=1e-4)


@pytest.mark.parametrize("signal", ["OP", "PV"])
def test_a_signal_without_any_number_is_told(tmp_path: Path, signal: str) -> None:
    rows = [list(row) for row in table()]
    place = HEADER.index(signal)
    for row in rows:
        row[place] = "about half"
    problem = str(one(write(tmp_path / "a.csv", text(rows))).problem)
    assert f"column {signal} holds no number, but 'about half'" in problem
    assert f"--{signal.lower()} TAG=COLUMN" in problem


def test_minutes_without_their_seconds_are_spread(tmp_path: Path) -> None:
    def minute(k: int) -> str:
        at = BEGIN + datetime.timedelta(seconds=STEP * k)
        return f"{at:%Y-%m-%d %H:%M}"

    each = round(60.0 / STEP)
    rows = table(minute)
    loop = one(write(tmp_path / "a.csv", text(rows)))
    assert f"{each} rows on each" in said(loop)
    part = loop.parts[0]
    assert part.sample_time == pytest.approx(STEP)
    assert part.op[:, 0] == pytest.approx([op(k) for k in range(ROWS)], abs=1e-4)
    begun = one(write(tmp_path / "b.csv", text(rows[3:])))  # in the middle of a minute
    assert begun.parts[0].start - part.start == pytest.approx(3 * STEP)
    strict = str(one(tmp_path / "a.csv", strict=True).problem)
    assert "time does not increase" in strict


def test_rows_that_are_there_twice_are_not_spread(tmp_path: Path) -> None:
    rows = [row for row in table() for _ in range(2)]
    loop = one(write(tmp_path / "a.csv", text(rows)))
    assert loop.parts[0].sample_time == pytest.approx(STEP)
    assert "with the time stamp of an earlier row: left out" in said(loop)


@pytest.mark.parametrize(("zone", "hours"), [("UTC", 0), ("CET", 1), ("CEST", 2), ("EDT", -4)])
def test_zones_by_their_names(tmp_path: Path, zone: str, hours: int) -> None:
    rows = [[f"{row[0]} {zone}", *row[1:]] for row in table()]
    begin = one(write(tmp_path / "a.csv", text(rows))).parts[0].start
    plain = one(write(tmp_path / "b.csv", text(table()))).parts[0].start
    assert begin - plain == pytest.approx(-3600.0 * hours)


def test_a_fraction_in_brackets_becomes_percent(tmp_path: Path) -> None:
    rows = [[t, f"{float(op) / 100.0:.8f}", pv, sp] for t, op, pv, sp in table()]
    header = ["time", "OP (frac)", "PV", "SP"]
    check(one(write(tmp_path / "a.csv", text(rows, header))))


def test_modes_with_a_word_in_brackets(tmp_path: Path) -> None:
    held, words = op(40), ("Auto (remote)", "Manual (operator)")
    rows = [
        [t, f"{held:.6f}" if 40 <= k < 60 else of_op, of_pv, of_sp, words[40 <= k < 60]]
        for k, (t, of_op, of_pv, of_sp) in enumerate(table())
    ]
    loop = one(write(tmp_path / "a.csv", text(rows, [*HEADER, "MODE"])))
    masks = np.concatenate([np.asarray(part.quality) for part in loop.parts])
    assert np.count_nonzero(masks == Quality.MANUAL) == 20
