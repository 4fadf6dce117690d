"""Tables of columns, and by packages of the extra ``survey`` Parquet files and workbooks."""

import contextlib
import datetime
import functools
import re
import warnings
import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.intake.sheets import text
from stiction_ros.intake.sheets.cells import Cells
from stiction_ros.intake.sheets.layout import named_columns
from stiction_ros.intake.sheets.sheet import PIECE, Piece, RowSheet, Sheet, stem, text_sheet

INSTALL = "install the extra: pip install 'stiction_ros[survey]'"

UNSTORED = re.compile(
    rb'<c r="([A-Z]+\d+)"[^>]*><f(?:[^>]*/>|[^>]*>[^<]*</f>)(?:<v */>|<v></v>)?</c>'
)
"""A cell with a formula and no value."""


Batches = Callable[[int], Iterator[Sequence[Cells]]]
"""Reads a table anew, so many rows at a time: the cells of each column."""


class ColumnSheet(Sheet):
    """Columns of numbers, stamps or texts, read in batches; rows count from ``first``."""

    row_word = "row"

    def __init__(self, path: Path, names: Sequence[str], batches: Batches, first: int) -> None:
        self.path, self.name = path, stem(path)
        self.layout = named_columns([" ".join(name.split()) for name in names])
        self._batches, self._first = batches, first

    def pieces(self, rows: int | None = None) -> Iterator[Piece]:
        line = self._first
        for columns in self._batches(rows or max(PIECE // max(len(self.layout.header), 1), 256)):
            yield columns, np.arange(line, line + len(columns[0]))
            line += len(columns[0])


def open_sheets(path: Path) -> Sequence[Sheet]:
    """Open the tables of a file, whatever kind it is; a workbook may hold several."""
    first = text.magic(path)
    if first.startswith(text.PARQUET):
        return [_parquet(path)]
    if first.startswith(text.ZIP) and _holds_workbook(path):
        return _workbook(path)
    return [text_sheet(path)]


def _parquet(path: Path) -> Sheet:
    """Open a Parquet file; numbers and stamps come as they are."""
    try:
        import pyarrow as arrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise InputError("needs pyarrow", fix=INSTALL) from None

    def cells(column: Any) -> Cells:
        kind, types = column.type, arrow.types
        if types.is_timestamp(kind) or types.is_date(kind):
            stamps = column.cast(arrow.timestamp("us", tz=getattr(kind, "tz", None)))
            whole = stamps.cast(arrow.int64()).fill_null(np.iinfo(np.int64).min)
            return np.asarray(whole.to_numpy(zero_copy_only=False)).view("datetime64[us]")
        if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
            values = column.cast(arrow.float64()).to_numpy(zero_copy_only=False)
            return np.asarray(values, dtype=np.float64)
        return ["" if value is None else str(value) for value in column.to_pylist()]

    def batches(size: int) -> Iterator[Sequence[Cells]]:
        with parquet.ParquetFile(path) as file:
            for batch in file.iter_batches(batch_size=size):
                yield list(map(cells, batch.columns))

    return ColumnSheet(path, list(map(str, parquet.read_schema(path).names)), batches, 1)


def _holds_workbook(path: Path) -> bool:
    """Return whether an archive is a workbook, or is called one."""
    try:
        with zipfile.ZipFile(path) as archive:
            inner = any(name.startswith("xl/workbook.") for name in archive.namelist())
    except (zipfile.BadZipFile, OSError):
        inner = False
    return inner or path.suffix.lower() in (".xlsx", ".xlsm")


def _workbook(path: Path) -> Sequence[Sheet]:
    """Open the sheets of a workbook, those without a table left out if there are others."""
    found: list[RowSheet] = []
    refused: list[InputError] = []
    with _book(path) as book:
        for sheet in book.worksheets:
            try:
                _refuse_unstored(path, sheet)
                rows = functools.partial(_rows, path, sheet.title)
                found.append(RowSheet(path, f"{stem(path)}:{sheet.title}", rows, ""))
            except InputError as error:
                refused.append(error)
    if not found:
        raise refused[0] if refused else InputError("has no sheet")
    if len(found) == 1:
        found[0].name = stem(path)
    return found


@contextlib.contextmanager
def _book(path: Path) -> Iterator[Any]:
    """Open a workbook; what openpyxl raises is an InputError."""
    try:
        import openpyxl
    except ImportError:
        raise InputError("needs openpyxl", fix=INSTALL) from None
    try:
        # From an open file: openpyxl asks for the end of a name.
        with warnings.catch_warnings(), path.open("rb") as file:
            warnings.simplefilter("ignore")  # of styles and the like, which are not read
            yield openpyxl.load_workbook(file, read_only=True, data_only=True)
    except (zipfile.BadZipFile, KeyError, OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"is no workbook ({error})", fix="save it as .xlsx or CSV") from None


@contextlib.contextmanager
def _rows(path: Path, title: str) -> Iterator[Iterator[tuple[int, list[str]]]]:
    """Open a sheet; its rows with their numbers."""
    with _book(path) as book:
        rows = enumerate(book[title].iter_rows(values_only=True), start=1)
        yield ((line, list(map(_text, row))) for line, row in rows)


def _refuse_unstored(path: Path, sheet: Any) -> None:
    """Raise where a cell has a formula and no value, as programs leave it that write them."""
    with zipfile.ZipFile(path) as archive, archive.open(sheet._worksheet_path) as file:
        found = UNSTORED.search(file.read(PIECE))
    if found:
        raise InputError(
            f"cell {found[1].decode()} of {sheet.title} is a formula without its value",
            fix="open it in a spreadsheet program and save it, as CSV or as .xlsx",
        )


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, datetime.datetime):
        return value.isoformat(sep=" ")
    return repr(value) if isinstance(value, float) else str(value)
