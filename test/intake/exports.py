"""Rows of a loop for tests, and files of them."""

import datetime
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from stiction_ros.intake import IntakeOptions, Loop, loops

BEGIN = datetime.datetime(2024, 10, 17, 21, 55, tzinfo=datetime.UTC)
ROWS = 120
STEP = 10

Row = list[str]


def iso(k: int) -> str:
    return (BEGIN + datetime.timedelta(seconds=STEP * k)).strftime("%Y-%m-%d %H:%M:%S")


def styled(form: str) -> Callable[[int], str]:
    return lambda k: (BEGIN + datetime.timedelta(seconds=STEP * k)).strftime(form)


def op(k: int) -> float:
    return round(50.0 + 10.0 * float(np.sin(k / 9.0)), 4)


def pv(k: int) -> float:
    return round(200.0 + 7.0 * float(np.cos(k / 9.0)) + 0.3 * ((7 * k) % 5), 4)


def sp(k: int) -> float:
    return 200.0


def table(stamp: Callable[[int], str] = iso, rows: int = ROWS) -> list[Row]:
    """Time, OP, PV, SP."""
    return [[stamp(k), str(op(k)), str(pv(k)), str(sp(k))] for k in range(rows)]


HEADER = ["time", "OP", "PV", "SP"]


def text(rows: Sequence[Sequence[str]], header: Sequence[str] = HEADER, mark: str = ",") -> str:
    return "".join(mark.join(row) + "\n" for row in [header, *rows])


def write(path: Path, content: str, encoding: str = "utf-8") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content.encode(encoding))
    return path


def read(path: Path, **options: object) -> list[Loop]:
    return list(loops([path], IntakeOptions(**options)))  # type: ignore[arg-type]


def one(path: Path, **options: object) -> Loop:
    (loop,) = read(path, **options)
    return loop


def said(loop: Loop) -> str:
    return "; ".join(loop.notes)


def check(loop: Loop, rows: int = ROWS) -> None:
    """The loop is the one of :func:`table`, value by value."""
    assert loop.problem is None
    (record,) = loop.parts
    assert len(record) == rows
    assert abs(record.sample_time - STEP) < 1e-9
    np.testing.assert_allclose(record.op[:, 0], [op(k) for k in range(rows)], atol=1e-9)
    np.testing.assert_allclose(record.pv[:, 0], [pv(k) for k in range(rows)], atol=1e-9)
