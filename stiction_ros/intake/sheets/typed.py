"""Workbooks and Parquet files, by packages of the extra ``survey``."""

import contextlib
import datetime
import functools
import re
import warnings
import weakref
import zipfile
from collections.abc import Iterator, Sequence
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


def open_sheets(path: Path) -> Sequence[Sheet]:
    """Open the tables of a file, whatever kind it is; a workbook may hold several."""
    first = text.magic(path)
    if first.startswith(text.PARQUET):
        return [ParquetSheet(path)]
    if first.startswith(text.ZIP) and _holds_workbook(path):
        return _workbook(path)
    return [text_sheet(path)]


class ParquetSheet(Sheet):
    """A Parquet file; numbers and stamps come as they are."""

    row_word = "row"

    def __init__(self, path: Path) -> None:
        try:
            import pyarrow as arrow
            import pyarrow.parquet as parquet
        except ImportError:
            raise InputError("needs pyarrow", fix=INSTALL) from None
        self.path, self.name, self._arrow, self._parquet = path, stem(path), arrow, parquet
        with self._open() as file:
            names = [" ".join(str(name).split()) for name in file.schema_arrow.names]
        self.layout = named_columns(names)

    def pieces(self, rows: int | None = None) -> Iterator[Piece]:
        size = rows or max(PIECE // max(len(self.layout.header), 1), 256)
        first = 1
        with self._open() as file:
            for batch in file.iter_batches(batch_size=size):
                columns = [self._cells(column) for column in batch.columns]
                yield columns, np.arange(first, first + batch.num_rows)
                first += batch.num_rows

    def _cells(self, column: Any) -> Cells:
        kind = column.type
        types = self._arrow.types
        if types.is_timestamp(kind) or types.is_date(kind):
            stamps = column.cast(self._arrow.timestamp("us", tz=getattr(kind, "tz", None)))
            whole = stamps.cast(self._arrow.int64()).fill_null(np.iinfo(np.int64).min)
            return np.asarray(whole.to_numpy(zero_copy_only=False)).view("datetime64[us]")
        if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
            values = column.cast(self._arrow.float64()).to_numpy(zero_copy_only=False)
            return np.asarray(values, dtype=np.float64)
        return ["" if value is None else str(value) for value in column.to_pylist()]

    @contextlib.contextmanager
    def _open(self) -> Iterator[Any]:
        try:
            with self._parquet.ParquetFile(self.path) as file:
                yield file
        except (self._arrow.ArrowException, OSError) as error:
            raise InputError(f"cannot be read ({str(error).splitlines()[0][:80]})") from None


class _Book:
    """A workbook that its sheets share: what they have in common is read once."""

    def __init__(self, path: Path) -> None:
        try:
            import openpyxl
        except ImportError:
            raise InputError("needs openpyxl", fix=INSTALL) from None
        self.path = path
        with self.damage_told(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and the like, which are not read
            # From an open file: openpyxl asks for the end of a name.
            file = path.open("rb")
            self.book = openpyxl.load_workbook(file, read_only=True, data_only=True)
        for opened in (self.book, file):
            weakref.finalize(self, opened.close)

    @contextlib.contextmanager
    def damage_told(self) -> Iterator[None]:
        """Turn what openpyxl raises into an InputError."""
        try:
            yield
        except (zipfile.BadZipFile, KeyError, OSError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            fix = "save it as .xlsx or CSV"
            raise InputError(f"is no workbook ({error})", fix=fix) from None

    @contextlib.contextmanager
    def rows(self, title: str) -> Iterator[Iterator[tuple[int, list[str]]]]:
        """Open a sheet; its rows with their numbers."""
        with self.damage_told():
            yield (
                (line, [_text(value) for value in row])
                for line, row in enumerate(self.book[title].iter_rows(values_only=True), start=1)
            )

    def refuse_unstored(self, title: str) -> None:
        """Raise where a cell has a formula and no value, as programs leave it that write them."""
        with (
            self.damage_told(),
            zipfile.ZipFile(self.path) as archive,
            archive.open(self.book[title]._worksheet_path) as file,
        ):
            found = UNSTORED.search(file.read(PIECE))
        if found:
            raise InputError(
                f"cell {found[1].decode()} of {title} is a formula without its value",
                fix="open it in a spreadsheet program and save it, as CSV or as .xlsx",
            )


def _holds_workbook(path: Path) -> bool:
    """Return whether an archive is a workbook, or is called one."""
    try:
        with zipfile.ZipFile(path) as archive:
            inner = any(name.startswith("xl/workbook.") for name in archive.namelist())
    except (zipfile.BadZipFile, OSError):
        inner = False
    return inner or path.suffix.lower() in (".xlsx", ".xlsm")


def _workbook(path: Path) -> Sequence[Sheet]:
    book, found = _Book(path), []
    refused = InputError("has no sheet")
    for title in reversed([sheet.title for sheet in book.book.worksheets]):
        try:
            book.refuse_unstored(title)
            rows = functools.partial(book.rows, title)
            found.append(RowSheet(path, f"{stem(path)}:{title}", rows, ""))
        except InputError as error:
            refused = error
    if not found:
        raise refused
    if len(found) == 1:
        found[0].name = stem(path)
    return found[::-1]


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, datetime.datetime):
        return value.isoformat(sep=" ")
    return repr(value) if isinstance(value, float) else str(value)
