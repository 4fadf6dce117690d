"""A record that nothing can be said of gives one clear error, never a number."""

import sys
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.cli.main import main

sys.path.insert(0, str(Path(__file__).parents[1] / "identification"))
from simulated_loops import example1

Rows = list[list[float | str]]


def loop() -> Rows:
    record = example1(1, samples=400)
    assert record.sp is not None
    columns = (record.time, record.op[:, 0] + 50.0, record.pv[:, 0] + 50.0, record.sp[:, 0] + 50.0)
    return [list(row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def constant_op(rows: Rows) -> Rows:
    return [[t, 50.0, pv, sp] for t, _, pv, sp in rows]


def gap_of_nan(rows: Rows) -> Rows:
    return [[t, op, "nan" if 100 <= k < 120 else pv, sp] for k, (t, op, pv, sp) in enumerate(rows)]


def twenty(rows: Rows) -> Rows:
    return rows[:20]


def irregular(rows: Rows) -> Rows:
    steps = np.random.default_rng(0).choice([1.0, 2.0, 5.0], len(rows)).cumsum()
    return [[float(t), *row[1:]] for t, row in zip(steps, rows, strict=True)]


def text(rows: Rows) -> Rows:
    return [*rows[:50], [50.0, 50.0, "Bad", 50.0], *rows[51:]]


def swapped(rows: Rows) -> Rows:
    return [[t, pv, op, sp] for t, op, pv, sp in rows]


def same(rows: Rows) -> Rows:
    return rows


@pytest.mark.parametrize(
    ("spoil", "options", "words"),
    [
        (constant_op, (), "op of V1 is constant"),
        (gap_of_nan, ("--strict",), "first: line 102"),
        (twenty, (), "20 samples are too few"),
        (irregular, ("--strict",), "time is irregular"),
        (text, ("--strict",), "'Bad'), first: line 52"),
        (swapped, (), "OP and PV look swapped"),
        (same, ("--delay", "0:390"), "samples are too few"),
    ],
)
@pytest.mark.parametrize("method", ["exact", "nlp", "grid"])
def test_bad_record_is_one_clear_error(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    spoil: object,
    options: tuple[str, ...],
    words: str,
    method: str,
) -> None:
    assert callable(spoil)
    lines = [",".join(map(str, row)) for row in spoil(loop())]
    path = tmp_path / "record.csv"
    path.write_text("\n".join(["t,OP,PV,SP", *lines]) + "\n", encoding="utf-8")
    assert main(["identify", str(path), "--method", method, "--json", "-", *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert len(err.strip().splitlines()) == 1
