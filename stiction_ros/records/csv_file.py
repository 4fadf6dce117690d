"""Reads a record of one loop from a CSV file, as historians export them."""

from __future__ import annotations

import csv
import dataclasses
import datetime
import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.csv_names import (
    DEFAULT_OUTPUT,
    DEFAULT_VALVE,
    QUALITY,
    tagged_columns,
)
from stiction_ros.records.parts import only_part
from stiction_ros.records.quality import QUALITY_WORDS, Quality, QualityArray
from stiction_ros.records.record import Record
from stiction_ros.records.whole import Source, Whole

_TIME_NAMES = ("t", "time", "timestamp")
_DELIMITERS = (",", ";", "\t")


@dataclasses.dataclass(frozen=True)
class CsvColumns:
    """Which column is what; a tag to its column, None for the default names.

    In a file that :func:`stiction_ros.records.csv_writer.write_csv` wrote the default is what
    is written there, ``TAG.OP``, ``TAG.PV`` … included.

    Attributes:
        op: valve to column of its OP, default ``{"V1": "OP"}``.
        pv: output to column, default ``{"PV1": "PV"}``.
        sp: output to column of its set-point, default ``SP`` when it is there.
        stem: valve to column of its measured stem, default ``STEM`` when it is there.
        time: column of the time, default ``t``, then ``time`` or ``timestamp``.

    Examples:
        >>> from stiction_ros import CsvColumns
        >>> columns = CsvColumns(op={"V1": "FIC101.OP"}, pv={"PV1": "FIC101.PV"}, time="stamp")
        >>> columns.sp is None  # taken from the column SP where there is one
        True
    """

    op: Mapping[str, str] | None = None
    pv: Mapping[str, str] | None = None
    sp: Mapping[str, str] | None = None
    stem: Mapping[str, str] | None = None
    time: str | None = None


def read_csv(
    path: str | Path,
    *,
    op: Mapping[str, str] | None = None,
    pv: Mapping[str, str] | None = None,
    sp: Mapping[str, str] | None = None,
    stem: Mapping[str, str] | None = None,
    time: str | None = None,
) -> Record:
    """Read a CSV file with a header; comma, semicolon or tab between the cells.

    Time is in seconds or ISO 8601 stamps (those without a zone are taken as UTC). Other
    columns are ignored, but for the qualities that :func:`write_csv` writes. With semicolons
    or tabs the decimal sign may be a comma.

    Args:
        path: the file.
        op: see :class:`CsvColumns`, as the others.
        pv: …
        sp: …
        stem: …
        time: …

    Raises:
        InputError: no such file or column; a cell that is empty, not a number or not
            finite; time that does not increase, is irregular or has gaps; fewer than two
            rows.
    """
    return only_part(read_csv_parts(path, CsvColumns(op, pv, sp, stem, time)), str(path))


def read_csv_parts(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),
) -> tuple[Record, ...]:
    """Read a CSV file as :func:`read_csv` does, split where it has gaps.

    A step of more than 5.5 usual ones is a gap. Slightly irregular samples are brought onto a
    regular grid, see :func:`stiction_ros.records.regular.regular_part`; the notes of each
    record say what was done.

    Raises:
        InputError: as :func:`read_csv` but for gaps.
    """
    table = _Table.read(Path(path))
    return _records(table, columns)


@dataclasses.dataclass(frozen=True)
class _Table:
    """Header and cells of a file; ``lines`` are the line numbers of the rows."""

    path: Path
    header: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    lines: Sequence[int]
    decimal_comma: bool

    @staticmethod
    def read(path: Path) -> _Table:
        text = _text(path)
        first = next((line for line in text.splitlines() if line.strip()), "")
        delimiter = max(_DELIMITERS, key=re.sub('"[^"]*"', "", first).count)
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        header: tuple[str, ...] = ()
        rows, lines = [], []
        try:
            for cells in reader:
                if not any(cell.strip() for cell in cells):
                    continue
                if not header:
                    header = tuple(" ".join(cell.split()) for cell in cells)
                    continue
                rows.append(cells)
                lines.append(reader.line_num)
        except csv.Error as error:
            raise InputError(
                f"line {reader.line_num} is no CSV ({error})", where=str(path)
            ) from None
        if not header:
            raise InputError("is empty", where=str(path), fix="give a CSV file with a header")
        if all(_is_number(cell) for cell in header):
            raise InputError(
                "has no header, its first line is numbers",
                where=str(path),
                fix="put the names of the columns above them, such as t,OP,PV,SP",
            )
        return _Table(path, header, rows, lines, delimiter != ",")

    def find(self, name: str) -> int | None:
        """Return the index of the column ``name``, its exact case first; None if absent."""
        name = " ".join(name.split())
        exact = [i for i, column in enumerate(self.header) if column == name]
        folded = name.casefold()
        found = exact or [i for i, column in enumerate(self.header) if column.casefold() == folded]
        if len(found) > 1:
            raise InputError(
                f"column {name} is there {len(found)} times",
                where=str(self.path),
                fix="rename one of them",
            )
        return found[0] if found else None

    def column(self, name: str, option: str) -> int:
        """Return the index of the column ``name`` or raise with those present."""
        index = self.find(name)
        if index is None:
            raise InputError(
                f"has no column {name}",
                where=str(self.path),
                fix=f"its columns are {', '.join(self.header)}; choose with {option}",
            )
        return index

    def cells(self, index: int, mask: QualityArray | None = None) -> list[str]:
        """Return one column as text; empty cells of bad rows as ``nan``.

        Raises:
            InputError: a row that ends before it, or an empty cell.
        """
        values = []
        for row, (cells, line) in enumerate(zip(self.rows, self.lines, strict=True)):
            value = cells[index].strip() if index < len(cells) else ""
            if not value:
                if mask is None or mask[row] != Quality.BAD:
                    raise self.bad(index, line, "is empty")
                value = "nan"
            values.append(value)
        return values

    def numbers(self, index: int, mask: QualityArray | None = None) -> FloatArray:
        """Return one column as numbers, shape (N,), those of bad rows perhaps NaN.

        Raises:
            InputError: a cell that is empty, not a number or not finite.
        """
        values = []
        for row, (cell, line) in enumerate(zip(self.cells(index, mask), self.lines, strict=True)):
            value = self._number(cell)
            if mask is not None and mask[row] == Quality.BAD:
                values.append(math.nan if value is None else value)
                continue
            if value is None:
                raise self.bad(index, line, f"is {cell[:30]!r}, not a number")
            if not math.isfinite(value):
                raise self.bad(index, line, f"is {cell[:30]}, not a finite number")
            values.append(value)
        return np.array(values, dtype=float)

    def _number(self, cell: str) -> float | None:
        if self.decimal_comma and "." not in cell:
            cell = cell.replace(",", ".")
        return _float(cell)

    def place(self, row: int) -> str:
        """Name a row of data for errors."""
        return f"line {self.lines[row]}"

    def bad(self, index: int, line: int, what: str) -> InputError:
        """Return the error for one cell."""
        return InputError(
            f"column {self.header[index]} {what} in line {line}",
            where=str(self.path),
            fix="correct it, fill it or cut the record there",
        )


def _records(table: _Table, columns: CsvColumns) -> tuple[Record, ...]:
    written = tagged_columns(table.header)
    op = columns.op or written.get("op") or {DEFAULT_VALVE: "OP"}
    pv = columns.pv or written.get("pv") or {DEFAULT_OUTPUT: "PV"}
    sp, stem = columns.sp, columns.stem
    if sp is None and columns.pv is None:
        plain = {DEFAULT_OUTPUT: "SP"} if table.find("SP") is not None else None
        sp = written.get("sp", plain)
    if stem is None and columns.op is None:
        plain = {DEFAULT_VALVE: "STEM"} if table.find("STEM") is not None else None
        stem = written.get("stem", plain)
    _same_tags(sp, pv, "--sp", table.path)
    _same_tags(stem, op, "--stem", table.path)
    # The missing column is told before any bad cell: that is the likelier slip.
    time_column = _time_column(table, columns.time)
    signals = {"--op": op, "--pv": pv, "--sp": sp, "--stem": stem}
    for option, mapping in signals.items():
        for column in (mapping or {}).values():
            table.column(column, f"{option} TAG=COLUMN")
    if len(table.rows) < 2:
        raise InputError(
            f"has {len(table.rows)} row{'s' * (len(table.rows) != 1)} of data",
            where=str(table.path),
            fix="a record needs two at least",
        )
    seconds, start = _time(table, time_column)
    mask = _mask(table)
    whole = Whole(
        valves=tuple(op),
        outputs=tuple(pv),
        time=seconds,
        start=start,
        op=_signals(table, op, tuple(op), mask),
        pv=_signals(table, pv, tuple(pv), mask),
        sp=None if not sp else _signals(table, sp, tuple(pv), mask),
        stem=None if not stem else _signals(table, stem, tuple(op), mask),
        mask=mask,
    )
    return whole.records(Source(table.path.name, str(table.path), table.place))


def _mask(table: _Table) -> QualityArray | None:
    """Return the qualities, shape (N,), when a column of that name holds nothing else."""
    index = table.header.index(QUALITY) if QUALITY in table.header else None
    if index is None:
        return None
    words = [cells[index].strip() if index < len(cells) else "" for cells in table.rows]
    if not QUALITY_WORDS.keys() >= set(words):
        return None  # a historian's own column
    return np.array([QUALITY_WORDS[word] for word in words], dtype=np.uint8)


def _signals(
    table: _Table, mapping: Mapping[str, str], tags: tuple[str, ...], mask: QualityArray | None
) -> FloatArray:
    """Return the columns of ``tags`` side by side, shape (N, len(tags))."""
    columns = [table.numbers(table.column(mapping[tag], ""), mask) for tag in tags]
    return np.column_stack(columns)


def _same_tags(
    part: Mapping[str, str] | None, whole: Mapping[str, str], option: str, path: Path
) -> None:
    if part and set(part) != set(whole):
        raise InputError(
            f"{option} names {', '.join(sorted(part))}",
            where=str(path),
            fix=f"it needs one column for each of {', '.join(whole)}",
        )


def _time_column(table: _Table, name: str | None) -> int:
    if name is None:
        for usual in _TIME_NAMES:
            index = table.find(usual)
            if index is not None:
                return index
    return table.column(name or "t", "--time COLUMN")


def _time(table: _Table, index: int) -> tuple[FloatArray, float]:
    """Return seconds since the first sample, shape (N,), and the first on its own clock."""
    cells = table.cells(index)
    if table._number(cells[0]) is not None:
        seconds = table.numbers(index)
        return seconds - seconds[0], float(seconds[0])
    stamps = []
    for cell, line in zip(cells, table.lines, strict=True):
        stamp = _stamp(cell)
        if stamp is None:
            raise table.bad(index, line, f"is {cell[:30]!r}, neither seconds nor an ISO stamp")
        stamps.append(stamp)
    first = stamps[0]
    return np.array([(stamp - first).total_seconds() for stamp in stamps]), first.timestamp()


def _stamp(cell: str) -> datetime.datetime | None:
    try:
        stamp = datetime.datetime.fromisoformat(cell)
    except ValueError:
        return None
    return stamp if stamp.tzinfo else stamp.replace(tzinfo=datetime.UTC)


def _float(cell: str) -> float | None:
    """Return the number in ``cell``; None for text and for ``1_000``."""
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def _is_number(cell: str) -> bool:
    return _float(cell) is not None


def _text(path: Path) -> str:
    where = str(path)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError("no such file", where=where, fix="check the path") from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=where) from None
    if b"\0" in data[:4096]:
        raise InputError("is no text", where=where, fix="save it as CSV in UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
