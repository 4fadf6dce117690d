"""Workbooks and Parquet files, by packages of the extra ``survey``."""

from __future__ import annotations

import contextlib
import datetime
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.intake.sheets import text
from stiction_ros.intake.sheets.cells import Cells
from stiction_ros.intake.sheets.layout import BRACKETS, Layout
from stiction_ros.intake.sheets.sheet import PIECE, Piece, RowSheet, Sheet, stem, text_sheet

INSTALL = "install the extra: pip install 'stiction_ros[survey]'"


def open_sheets(path: Path) -> list[Sheet]:
    """Open the tables of a file, whatever kind it is; a workbook may hold several.

    Raises:
        InputError: it cannot be read, holds no table, or the package for it is missing.
    """
    first = text.magic(path)
    if first.startswith(text.PARQUET):
        return [ParquetSheet(path)]
    if first.startswith(text.ZIP) and path.suffix.lower() in (".xlsx", ".xlsm"):
        return _workbook(path)
    return [text_sheet(path)]


class ParquetSheet(Sheet):
    """A Parquet file; numbers and stamps come as they are.

    Raises:
        InputError: pyarrow is missing, or the file is damaged.
    """

    def __init__(self, path: Path) -> None:
        try:
            import pyarrow as arrow
            import pyarrow.parquet as parquet
        except ImportError:
            raise InputError("needs pyarrow", where=str(path), fix=INSTALL) from None
        self.path, self.name, self._arrow, self._parquet = path, stem(path), arrow, parquet
        with self._open() as file:
            names = tuple(" ".join(str(name).split()) for name in file.schema_arrow.names)
        bare = tuple(BRACKETS.sub("", name) or name for name in names)
        found = [BRACKETS.search(name) for name in names]
        units = tuple(hit[1].strip() if hit else "" for hit in found)
        self.layout = Layout(bare, names, units, 0, 0)

    @property
    def row_word(self) -> str:
        return "row"

    def pieces(self) -> Iterator[Piece]:
        size = max(PIECE // max(len(self.layout.header), 1), 256)
        first = 1
        with self._open() as file:
            for batch in file.iter_batches(batch_size=size):
                columns = [self._cells(column) for column in batch.columns]
                yield Piece(columns, np.arange(first, first + batch.num_rows))
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
            said = str(error).splitlines()[0][:80]
            raise InputError(f"cannot be read ({said})", where=str(self.path)) from None


def _workbook(path: Path) -> list[Sheet]:
    with _opened(path) as book:
        titles = [sheet.title for sheet in book.worksheets]
    found: list[Sheet] = []
    refused: list[InputError] = []
    for title in titles:
        name = stem(path) if len(titles) == 1 else f"{stem(path)}:{title}"
        try:
            found.append(RowSheet(path, name, _rows_of(path, title), ""))
        except InputError as error:
            refused.append(error)
    if not found:
        raise refused[0] if refused else InputError("has no sheet", where=str(path))
    if len(found) == 1:
        found[0].name = stem(path)
    return found


def _rows_of(path: Path, title: str) -> Any:
    @contextlib.contextmanager
    def rows() -> Iterator[Iterator[tuple[int, list[str]]]]:
        with _opened(path) as book:
            sheet = book[title]
            yield (
                (line, [_text(value) for value in row])
                for line, row in enumerate(sheet.iter_rows(values_only=True), start=1)
            )

    return rows


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        import openpyxl
    except ImportError:
        raise InputError("needs openpyxl", where=str(path), fix=INSTALL) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and the like, which are not read
            book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        try:
            yield book
        finally:
            book.close()
    except (zipfile.BadZipFile, KeyError, OSError) as error:
        raise InputError(f"is no workbook ({error})", where=str(path)) from None


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, datetime.datetime):
        return value.isoformat(sep=" ")
    return repr(value) if isinstance(value, float) else str(value)
