"""A table in a file, read a piece at a time."""

import abc
import contextlib
import csv
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stiction_ros.errors import InputError
from stiction_ros.intake.sheets import layout as tops
from stiction_ros.intake.sheets import text
from stiction_ros.intake.sheets.cells import Cells, is_number
from stiction_ros.intake.sheets.names import OR_ROW, folded
from stiction_ros.intake.sheets.stamps import is_stamp

PIECE = 200_000  # cells that are held as text at one time

_POINT, _COMMA = re.compile(r"[+-]?\d+\.\d+"), re.compile(r"[+-]?\d+,\d+")


Piece = tuple[Sequence[Cells], NDArray[np.int64]]
"""Some rows of a table: the cells of each column, and the line of each row, shape (n,)."""


class Sheet(abc.ABC):
    """A table with a header."""

    path: Path  # of the file
    name: str  # of the table: the file's, and the sheet's of a workbook that has several
    layout: tops.Layout  # header, units, where data begin
    decimal_comma: bool = False  # whether a comma alone in a number is the decimal one
    header_once: bool = False  # whether no row of data may be taken for the header that returns
    row_word: str = "line"  # what a row is called in errors

    @property
    def mended(self) -> list[str]:
        """What was put right in the rows that were read last, in sentences."""
        return []

    @abc.abstractmethod
    def pieces(self, rows: int | None = None) -> Iterator[Piece]:
        """Yield the data, so many ``rows`` at a time; None takes :data:`PIECE` cells."""

    def find(self, name: str) -> int | None:
        """Return the index of the one column ``name``, exact case first; None if absent."""
        name = " ".join(name.split())
        for names in (self.layout.given, self.layout.header):
            exact = [k for k, other in enumerate(names) if other == name]
            found = exact or [k for k, other in enumerate(names) if folded(other) == folded(name)]
            if len(found) > 1:
                raise InputError(
                    f"column {name} is there {len(found)} times", fix="rename one of them"
                )
            if found:
                return found[0]
        return None

    def column(self, name: str, option: str) -> int:
        """Return the index of the column ``name``; raise an :class:`InputError` if absent."""
        if (index := self.find(name)) is not None:
            return index
        fix = f"{self.columns_said}; choose with {option} {OR_ROW}"
        raise InputError(f"has no column {name}", fix=fix)

    @property
    def columns_said(self) -> str:
        """What its columns are, for errors."""
        return f"its columns are {', '.join(self.layout.given)}"


Rows = Callable[[], contextlib.AbstractContextManager[Iterator[tuple[int, list[str]]]]]
"""Opens a table anew and gives its rows with the numbers of their lines."""


class RowSheet(Sheet):
    """A table of text cells, row by row, with a ``delimiter``, empty for a workbook."""

    def __init__(self, path: Path, name: str, rows: Rows, delimiter: str) -> None:
        self.path, self.name, self._rows = path, name, rows
        with rows() as opened:
            filled = (cells for _, cells in opened if any(cell.strip() for cell in cells))
            top = list(itertools.islice(filled, tops.LOOKED_AT))
        if not top:
            raise InputError("is empty", fix="give a CSV file with a header")
        self.layout = tops.layout_of(top)
        if not self.layout.header or all(is_number(cell) for cell in self.layout.header):
            names = (delimiter or ",").join(
                ("OP", "PV") if len(top[0]) < 3 else ("t", "OP", "PV", "SP")[: len(top[0])]
            )
            fix = f"put the names of the columns above them, such as {names!r}"
            raise InputError("has no header, its first line is numbers", fix=fix)
        data = top[self.layout.first :]
        spare = [row for row in data if any(c.strip() for c in row[len(self.layout.header) :])]
        if data and len(spare) == len(data):
            raise InputError(
                f"has {len(data[0])} cells under {len(self.layout.header)} names",
                fix="name every column; decimal commas need semicolons or tabs between the cells",
            )
        quoted = [cell.strip() for row in data for cell in row]
        commas = any(map(_COMMA.fullmatch, quoted)) and not any(map(_POINT.fullmatch, quoted))
        self.decimal_comma = delimiter != "," or commas
        self._names = [_plain(cell) for cell in top[self.layout.place]]
        self._again: list[tuple[int, list[str]]] = []

    def pieces(self, rows: int | None = None) -> Iterator[Piece]:
        width = len(self.layout.header)
        size = rows or max(PIECE // width, 256)
        with self._rows() as opened:
            filled = (
                (line, cells)
                for line, cells in opened
                if (cells and cells[0]) or any(cell.strip() for cell in cells)
            )
            data = self._by_name(itertools.islice(filled, self.layout.first, None))
            while piece := list(itertools.islice(data, size)):
                lines, cells = zip(*piece, strict=True)
                padded = [row[:width] + [""] * (width - len(row)) for row in cells]
                yield list(zip(*padded, strict=True)), np.array(lines)

    def _by_name(self, rows: Iterator[tuple[int, list[str]]]) -> Iterator[tuple[int, list[str]]]:
        """Yield rows without headers that return; behind one in another order cells by name."""
        self._again = []
        names = {name for name in self._names if name}
        order: list[int] | None = None
        for line, cells in rows:
            if not names.isdisjoint(cells) and (given := self._header(cells)) is not None:
                self._again.append((line, given))
                order = None if self._is_same(given) else self._order(given)
            elif order is None:
                yield line, cells
            else:
                yield line, [cells[k] if 0 <= k < len(cells) else "" for k in order]

    def _header(self, cells: Sequence[str]) -> list[str] | None:
        """Return the names in a row that is a header of mostly these columns; None for data."""
        given = [_plain(cell) for cell in cells]
        told = [name for name in given if name]
        known = sum(name in self._names for name in told)
        data = any(is_number(name) or is_stamp(name) for name in told)
        return None if self.header_once or data or known < max(2, 0.5 * len(told)) else given

    def _is_same(self, given: Sequence[str]) -> bool:
        return given[: len(self._names)] == self._names

    def _order(self, given: Sequence[str]) -> list[int]:
        """Return where each column stands in rows under another header; -1 for nowhere."""
        at = {name: iter([k for k, other in enumerate(given) if other == name]) for name in given}
        return [next(at[name], -1) if name in at and name else -1 for name in self._names]

    @property
    def mended(self) -> list[str]:
        told = []
        same = [line for line, given in self._again if self._is_same(given)]
        if same:
            more = f" and {len(same) - 1} times more" if len(same) > 1 else ""
            told.append(f"the header stands again at {self.row_word} {same[0]}{more}, left out")
        for line, given in self._again:
            if line in same:
                continue
            lost = ",".join(name for name in self._names if name and name not in given)
            new = ",".join(name for name in given if name and name not in self._names)
            told.append(
                f"the header of {self.row_word} {line} has other columns or another order: what "
                f"follows is read by its names{f', without {lost}' if lost else ''}"
                f"{f'; {new} is left out' if new else ''}"
            )
        return told


def _plain(cell: str) -> str:
    return " ".join(cell.replace("\ufeff", "").split())


def text_sheet(path: Path) -> Sheet:
    """Open a text file; comma, semicolon, tab, bar or white space between the cells."""
    with text.open_text(path) as opened:
        lines = [line for line in itertools.islice(opened, tops.LOOKED_AT) if line.strip()]
    delimiter = tops.delimiter_of(lines)

    @contextlib.contextmanager
    def rows() -> Iterator[Iterator[tuple[int, list[str]]]]:
        with text.open_text(path) as opened:
            if delimiter == tops.SPACE:
                yield ((line, tops.spaced(row)) for line, row in enumerate(opened, start=1))
                return
            reader = csv.reader(opened, delimiter=delimiter)
            try:
                yield ((reader.line_num, cells) for cells in reader)
            except csv.Error as error:
                raise InputError(f"line {reader.line_num} is no CSV ({error})") from None

    return RowSheet(path, stem(path), rows, delimiter)


def stem(path: Path) -> str:
    """Return the name of a file without what its kind is called: ``a.csv.gz`` → ``a``."""
    name = path.name
    for _ in range(2):
        base, dot, suffix = name.rpartition(".")
        if not dot or not base or f".{suffix.lower()}" not in SUFFIXES:
            break
        name = base
    return name


TEXT = ("csv", "tsv", "txt", "tab", "dat", "gz", "zst", "zstd")

KINDS = (*TEXT, "parquet", "pq", "xlsx", "xlsm", "xls", "mcap", "db3")
SUFFIXES = frozenset(f".{end}" for end in KINDS)  # of files that are read from folders
