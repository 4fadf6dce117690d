"""Records from arrays and data frames, read as the columns of a file are."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.checks import one_of, shown
from stiction_ros.errors import InputError, foreign
from stiction_ros.intake.assembly import Found, loop_of
from stiction_ros.intake.intake_options import LETTERS, CsvColumns, IntakeOptions, OpUnit, TimeUnit
from stiction_ros.intake.sheets.cells import Cells
from stiction_ros.intake.sheets.layout import named_columns
from stiction_ros.intake.sheets.sheet import PIECE, Piece, Sheet
from stiction_ros.intake.sheets.stamps import DateOrder
from stiction_ros.intake.tables.plan import plan_of
from stiction_ros.intake.tables.reading import blocks_of
from stiction_ros.records.csv_names import column_name
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record
from stiction_ros.texts import plural

EMPTY = frozenset(("None", "nan", "NaN", "NaT", "<NA>"))
"""What missing values are as texts."""

_AS_ARGUMENTS = (
    (re.compile(r",? or (?:the tag|tags) with --tags F| \(or a row for this file in --tags\)"), ""),
    (re.compile(r"--(op|pv|sp|stem) (\w+)=(\w+)"), r"\1={'\2': '\3'}"),
    (re.compile(r"--([a-z]+)-([a-z]+) ([\w-]+)"), r"\1_\2='\3'"),
    (re.compile(r"--([a-z]+) (\w+)"), r"\1='\2'"),
    (re.compile(r"--([a-z]+)-([a-z]+)"), r"\1_\2"),
)
"""Options of the command to the arguments that are named after them."""


class ColumnSheet(Sheet):
    """Columns in memory.

    Args:
        name: for errors.
        columns: name to values, shape (N,) each: numbers, times or texts.

    Raises:
        InputError: columns that are not of one length.
    """

    row_word = "row"

    def __init__(self, name: str, columns: Mapping[str, Any]) -> None:
        self.path, self.name = Path(name), name
        self.layout = named_columns([" ".join(str(key).split()) for key in columns])
        self._cells = [_cells(values, str(key)) for key, values in columns.items()]
        lengths = {len(cells) for cells in self._cells}
        if len(lengths) > 1:
            said = ", ".join(
                f"{key} {len(cells)}" for key, cells in zip(columns, self._cells, strict=True)
            )
            raise InputError(f"the columns differ in length: {said}", where=name)
        self._count = lengths.pop() if lengths else 0

    def pieces(self, rows: int | None = None) -> Iterator[Piece]:
        size = rows or PIECE
        for first in range(0, self._count, size):
            last = min(first + size, self._count)
            yield [cells[first:last] for cells in self._cells], np.arange(first, last)


def record_from_arrays(
    time: Any,
    signals: Mapping[str, Any],
    tags: Mapping[str, Sequence[str] | None],
    *,
    name: str,
    options: Mapping[str, Any],
) -> Record:
    """Return :meth:`stiction_ros.records.record.Record.from_arrays`.

    Args:
        time: as there.
        signals: arrays of op, pv, sp and stem, as there.
        tags: given tags of the valves, ``V``, and the outputs, ``PV``.
        name: of the record.
        options: how to read it, by the names of its arguments.
    """
    there = {key: values for key, values in signals.items() if values is not None}
    given = {key: _table(values, key) for key, values in ({"op": None, "pv": None} | there).items()}
    own = {
        letter: tags[letter] or [f"{letter}{k + 1}" for k in range(given[key].shape[1])]
        for key, letter in (("op", "V"), ("pv", "PV"))
    }
    step = np.ndim(time) == 0
    if step and not (np.issubdtype(np.asarray(time).dtype, np.number) and 0 < time < np.inf):
        raise InputError(
            f"{shown(time)} is neither times nor a positive sample time in seconds",
            where="time",
            fix="give the time of each sample in seconds, as dates, or one sample time",
        )
    count = len(given["op"])
    times = time * np.arange(count) if step else time
    count = count if step else len(times)
    columns: dict[str, Any] = {"t": times}
    named: dict[str, dict[str, str]] = {}
    for key, table in given.items():
        of = own[LETTERS[key]]
        if table.shape != (count, len(of)):
            turned = table.shape[0] != count == table.shape[1]
            raise InputError(
                f"shape {table.shape} does not fit {count} samples of {plural(len(of), 'signal')}",
                where=key,
                fix=f"one row a sample: give {key}.T" if turned else "give one row a sample",
            )
        named[key] = {tag: column_name(key, tag) for tag in of}
        columns |= zip(named[key].values(), table.T, strict=True)
    found = _record(name, columns, CsvColumns(**named, time="t"), {**options, "time_unit": "s"})
    exact = step and np.isclose(found.sample_time, time)
    return dataclasses.replace(found, sample_time=float(time)) if exact else found


def record_from_frame(
    frame: Any,
    columns: Mapping[str, Any],
    time: Any,
    *,
    name: str,
    options: Mapping[str, Any],
) -> Record:
    """Return :meth:`stiction_ros.records.record.Record.from_dataframe`.

    Args:
        frame: as there.
        columns: of op, pv, sp and stem, as there.
        time: as there.
        name: of the record.
        options: how to read it, by the names of its arguments.
    """
    keys = getattr(frame, "columns", frame)
    if keys is frame and not isinstance(frame, Mapping):
        raise InputError(
            f"{type(frame).__name__} has no columns",
            where=name,
            fix="give a DataFrame or a mapping of columns, or call Record.from_arrays",
        )
    every = {str(key): frame[key] for key in keys}
    index = getattr(frame, "index", None)
    if time is not None and not isinstance(time, str):
        every, time = {"t": time} | {k: v for k, v in every.items() if k != "t"}, "t"
    elif index is not None and np.asarray(index).dtype.kind not in "iu":  # whole ones count rows
        own = str(getattr(index, "name", None) or "t")
        every = {own: index} | every
        time = own if time is None else time
    chosen = CsvColumns(**columns, time=time)
    for key in columns:
        for column in (getattr(chosen, key) or {}).values():
            one_of(column, every, key, "column")
    if isinstance(time, str):
        one_of(time, every, "time", "column")
    return _record(name, every, chosen, options)


def _record(
    name: str, columns: Mapping[str, Any], chosen: CsvColumns, options: Mapping[str, Any]
) -> Record:
    """Return the longest good record of columns; errors speak of arguments, not of options."""
    given = {key: value for key, value in options.items() if value is not None}
    kinds = {"op_unit": OpUnit, "time_unit": TimeUnit, "dates": DateOrder}
    for key, kind in kinds.items():
        if key in given:
            given[key] = one_of(given[key], kind, key)
    wanted = IntakeOptions(columns=chosen, **given)
    try:
        with foreign(name):
            sheet = ColumnSheet(name, columns)
            blocks = blocks_of(sheet, plan_of(sheet, wanted, None), wanted, None)
            (own,) = blocks.values()
            loop = loop_of(Found(name, name, tuple(own), named=True), wanted)
            found = longest_part(loop.parts)
    except InputError as error:
        raise InputError(
            _as_arguments(error.what), where=error.where, fix=_as_arguments(error.fix)
        ) from None
    return dataclasses.replace(found, notes=tuple(map(_as_arguments, found.notes)))


def _as_arguments(text: str) -> str:
    for option, argument in _AS_ARGUMENTS:
        text = option.sub(argument, text)
    return text


def _cells(values: Any, key: str) -> Cells:
    """Return a column as a file would give it: numbers, stamps, or texts, empty where missing."""
    found = np.asarray(values)
    if found.ndim != 1:
        raise InputError(f"has shape {found.shape}, not one value a row", where=key)
    if found.dtype.kind == "m":
        return np.asarray(found / np.timedelta64(1, "s"), dtype=np.float64)
    if found.dtype.kind == "M":
        return found
    if found.dtype.kind in "biuf":
        return found.astype(np.float64)
    texts = [str(value) for value in found.tolist()]
    return ["" if text in EMPTY else text for text in texts]


def _table(values: Any, key: str) -> Any:
    """Return a signal of shape (N,) or (N, k) as (N, k)."""
    try:
        found = np.asarray(values)
    except ValueError as error:
        raise InputError(f"is no array ({error})", where=key) from None
    if found.ndim not in (1, 2):
        raise InputError(
            f"has shape {found.shape}", where=key, fix="give shape (N,), or (N, k) for k signals"
        )
    return found[:, None] if found.ndim == 1 else found
