"""Five forms of an export: a file a loop, loops side by side, a value a row, Parquet, workbooks."""

import csv
import dataclasses
import datetime
import enum
import gzip
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import zstandard

from stiction_ros.errors import InputError
from stiction_studies.field.exports.stamps import StampStyle, stamp
from stiction_studies.field.exports.table import Cell, Table


class Form(enum.StrEnum):
    """How loops stand in files."""

    SINGLE = "single"
    WIDE = "wide"
    LONG = "long"
    PARQUET = "parquet"
    WORKBOOK = "workbook"


@dataclasses.dataclass(frozen=True)
class Style:
    """How a text file is written.

    Attributes:
        delimiter: between the cells.
        decimal: sign of the numbers.
        stamps: form of the times.
        encoding: of the text.
        packing: end of the name: empty, ``.gz`` or ``.zst``.
        title: whether rows with a title stand on top.
        unit_row: whether units stand in a row of their own, not in brackets.
    """

    delimiter: str = ","
    decimal: str = "."
    stamps: StampStyle = StampStyle.ISO
    encoding: str = "utf-8"
    packing: str = ""
    title: bool = False
    unit_row: bool = False


STYLES = (
    Style(),
    Style(";", ",", StampStyle.EUROPEAN, "cp1252", "", True, True),
    Style(",", ".", StampStyle.AMERICAN, "utf-8-sig", "", False, False),
    Style("\t", ".", StampStyle.PI, "utf-16", "", True, False),
    Style(",", ".", StampStyle.MILLISECONDS, "utf-8", ".gz", False, True),
    Style(";", ",", StampStyle.ZONED, "utf-8", ".zst", False, False),
    Style(",", ".", StampStyle.SECONDS, "utf-8", "", False, True),
)
"""What the text files of a plant are written in, one after the other."""


def text_cell(cell: Cell, decimal: str) -> str:
    """Return a cell as text."""
    if cell is None:
        return ""
    return cell if isinstance(cell, str) else f"{cell:.7g}".replace(".", decimal)


def write_single(table: Table, style: Style, folder: Path) -> Path:
    """Write one loop to a file of its own, its columns ``PV``, ``SP``, ``OP``, ``MODE``."""
    start = float(table.time.min())
    names = list(table.cells)
    rows = _head(["Time", *names], ["", *(table.units[name] for name in names)], style)
    for k, seconds in enumerate(table.time.tolist()):
        cells = (text_cell(table.cells[name][k], style.decimal) for name in names)
        rows.append([stamp(seconds, style.stamps, start), *cells])
    return _write(rows, style, folder / f"{table.tag}{_ending(style)}")


def write_wide(tables: Sequence[Table], style: Style, path: Path) -> Path:
    """Write loops of one clock side by side; rows that one of them lacks are empty there."""
    names, units, columns = _side_by_side(tables)
    times = sorted(columns)
    if any("turned" in table.faults for table in tables):
        times.reverse()
    rows = _head(["Timestamp", *names], ["", *units], style)
    for time in times:
        cells = columns[time]
        rows.append(
            [
                stamp(time / 1e3, style.stamps, times[0] / 1e3),
                *(text_cell(cells.get(name), style.decimal) for name in names),
            ]
        )
    return _write(rows, style, path.with_name(path.name + _ending(style)))


def write_long(tables: Sequence[Table], style: Style, path: Path) -> Path:
    """Write one value a row with tag, time, value, unit, quality.

    Signals that were kept when they changed have rows where they did.
    """
    rows = [["TagName", "Timestamp", "Value", "Unit", "Quality"]]
    for table in tables:
        start = float(table.time.min())
        for name, column in table.cells.items():
            pairs = list(zip(table.time.tolist(), column, strict=True))
            for seconds, cell in table.changes(name) if table.reported else pairs:
                good = cell is not None and (name == "MODE" or not isinstance(cell, str))
                rows.append(
                    [
                        f"{table.tag}.{name}",
                        stamp(seconds, style.stamps, start),
                        text_cell(cell, style.decimal),
                        table.units[name],
                        "Good" if good else "Bad",
                    ]
                )
    return _write(rows, style, path.with_name(path.name + _ending(style)))


def write_parquet(tables: Sequence[Table], path: Path) -> Path:
    """Write loops of one clock side by side as Parquet, words as nothing.

    Raises:
        InputError: pyarrow is missing.
    """
    try:
        import pyarrow as arrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise _missing("pyarrow") from None
    names, units, columns = _side_by_side(tables)
    times = np.array(sorted(columns), dtype="datetime64[ms]")
    data = {"timestamp": arrow.array(times)}
    for name, unit in zip(names, units, strict=True):
        cells = [columns[time].get(name) for time in sorted(columns)]
        if not name.endswith(".MODE"):
            cells = [None if isinstance(cell, str) else cell for cell in cells]
        data[f"{name} [{unit}]" if unit else name] = arrow.array(cells)
    path = path.with_name(path.name + ".parquet")
    parquet.write_table(arrow.table(data), path)
    return path


def write_workbook(tables: Sequence[Table], path: Path) -> Path:
    """Write loops to the sheets of a workbook, with a title and a row of units.

    Times are dates of the workbook where it has an even number of loops, else text.

    Raises:
        InputError: openpyxl is missing.
    """
    try:
        import openpyxl
    except ImportError:
        raise _missing("openpyxl") from None
    book = openpyxl.Workbook(write_only=True)
    for table in tables:
        sheet = book.create_sheet(table.tag)
        sheet.append([f"Trend of {table.tag}"])
        sheet.append([])
        sheet.append(["Time", *(f"{table.tag}.{name}" for name in table.cells)])
        sheet.append([None, *(table.units[name] or None for name in table.cells)])
        start = float(table.time.min())
        for k, seconds in enumerate(table.time.tolist()):
            cells = (column[k] for column in table.cells.values())
            at = stamp(seconds, StampStyle.ISO, start)
            dated = datetime.datetime.fromisoformat(at) if len(tables) % 2 == 0 else at
            sheet.append([dated, *cells])
    path = path.with_name(path.name + ".xlsx")
    book.save(path)
    return path


def _side_by_side(
    tables: Sequence[Table],
) -> tuple[list[str], list[str], dict[int, dict[str, Cell]]]:
    """Return names, units, and for each stamp in ms its cells by name."""
    names, units = [], []
    columns: dict[int, dict[str, Cell]] = {}
    for table in tables:
        for name, column in table.cells.items():
            names.append(f"{table.tag}.{name}")
            units.append(table.units[name])
            for seconds, cell in zip(table.time.tolist(), column, strict=True):
                columns.setdefault(round(1000.0 * seconds), {})[names[-1]] = cell
    return names, units, columns


def _head(names: list[str], units: list[str], style: Style) -> list[list[str]]:
    """Return the rows above the data."""
    rows = [["Historian export"], ["Interval: as kept"]] if style.title else []
    if style.unit_row:
        clock = "ms" if style.stamps is StampStyle.MILLISECONDS else ""
        return [*rows, names, [clock, *units[1:]]]
    bracketed = [f"{n} [{u}]" if u else n for n, u in zip(names, units, strict=True)]
    return [*rows, bracketed]


def _ending(style: Style) -> str:
    return (".tsv" if style.delimiter == "\t" else ".csv") + style.packing


def _write(rows: Sequence[Sequence[str]], style: Style, path: Path) -> Path:
    text = io.StringIO()
    csv.writer(text, delimiter=style.delimiter, lineterminator="\r\n").writerows(rows)
    data = text.getvalue().encode(style.encoding)
    if style.packing == ".gz":
        data = gzip.compress(data, mtime=0)
    elif style.packing == ".zst":
        data = zstandard.ZstdCompressor().compress(data)
    path.write_bytes(data)
    return path


def _missing(package: str) -> InputError:
    return InputError(
        f"needs {package}",
        where="plant",
        fix="install the extra: pip install 'stiction_ros[survey]'",
    )
