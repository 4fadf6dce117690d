"""Records from arrays and data frames, read as the columns of a file are."""

import dataclasses
import enum
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.checks import one_of, shown
from stiction_ros.errors import InputError, foreign
from stiction_ros.intake.assembly import Found, loop_of
from stiction_ros.intake.intake_options import LETTERS, CsvColumns, IntakeOptions, OpUnit, TimeUnit
from stiction_ros.intake.sheets.cells import Cells
from stiction_ros.intake.sheets.stamps import DateOrder
from stiction_ros.intake.sheets.typed import ColumnSheet
from stiction_ros.intake.tables.plan import plan_of
from stiction_ros.intake.tables.reading import blocks_of
from stiction_ros.intake.tables.tags import FileWay
from stiction_ros.records.csv_writer import column_name
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record
from stiction_ros.texts import plural

EMPTY = frozenset(("None", "nan", "NaN", "NaT", "<NA>"))  # what missing values are as texts

_WORDS: Mapping[str, type[enum.StrEnum]] = {
    "op_unit": OpUnit,
    "time_unit": TimeUnit,
    "dates": DateOrder,
}

_TAG_LISTS = re.compile(
    r",? or (?:the tag|tags) with --tags F| \(or a row for this file in --tags\)"
)
"""What an error advises of tag lists, which only files have."""


def record_from_arrays(
    time: Any,
    signals: Mapping[str, Any],
    tags: Mapping[str, Sequence[str] | None],
    name: str,
    op_unit: str | None,
) -> Record:
    """Return :meth:`stiction_ros.records.record.Record.from_arrays`, with its arguments."""
    step = np.ndim(time) == 0
    if step and not (np.asarray(time).dtype.kind in "iuf" and 0 < time < np.inf):
        raise InputError(
            f"{shown(time)} is neither times nor a positive sample time in seconds",
            where="time",
            fix="give the time of each sample in seconds, as dates, or one sample time",
        )
    with foreign("op"):
        count = max(np.shape(signals["op"]), default=0) if step else len(time)
    columns: dict[str, Any] = {"t": time * np.arange(count) if step else time}
    named: dict[str, dict[str, str]] = {}
    for key, values in signals.items():
        if values is None and key in ("sp", "stem"):
            continue
        with foreign(key):
            table = np.asarray(values)
        table = table[:, None] if table.ndim == 1 else table
        letter, of = LETTERS[key], named.get({"sp": "pv", "stem": "op"}.get(key, key))
        own = tags[letter] or of or [f"{letter}{k + 1}" for k in range((*table.shape, 1, 1)[1])]
        if table.shape != (count, len(own)):
            turned = table.ndim == 2 and table.shape[0] != count == table.shape[1]
            raise InputError(
                f"shape {table.shape} does not fit {plural(count, 'sample')}, one a row, of "
                f"{plural(len(own), 'signal')}",
                where=key,
                fix=f"give {key}.T" if turned else "",
            )
        named[key] = {tag: column_name(key, tag) for tag in own}
        columns |= zip(named[key].values(), table.T, strict=True)
    options = {"op_unit": op_unit, "time_unit": TimeUnit.SECONDS}
    found = _record(name, columns, CsvColumns(**named, time="t"), options)
    exact = step and np.isclose(found.sample_time, time)
    return dataclasses.replace(found, sample_time=float(time)) if exact else found


def record_from_frame(
    frame: Any, columns: Mapping[str, Any], time: Any, name: str, options: Mapping[str, Any]
) -> Record:
    """Return :meth:`stiction_ros.records.record.Record.from_dataframe`, with its arguments."""
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
        every, time = every | {"t": time}, "t"
    elif index is not None and np.asarray(index).dtype.kind not in "iu":  # whole ones count rows
        own = str(getattr(index, "name", None) or "t")
        every, time = every | {own: index}, time or own
    chosen = CsvColumns(**columns, time=time)
    named = [(key, col) for key in columns for col in (getattr(chosen, key) or {}).values()]
    for key, column in [*named, *([("time", time)] if time else [])]:
        one_of(column, every, key, "column")
    return _record(name, every, chosen, options)


def _record(
    name: str, columns: Mapping[str, Any], chosen: CsvColumns, options: Mapping[str, Any]
) -> Record:
    """Return the longest good record of columns; errors speak of arguments, not of options."""
    given = {key: value for key, value in options.items() if value is not None}
    for key in _WORDS.keys() & given.keys():
        given[key] = one_of(given[key], _WORDS[key], key)
    if "automatic" in given:
        given["automatic"] = tuple(np.atleast_1d(given["automatic"]).tolist())
    wanted = IntakeOptions(columns=chosen, **given)
    try:
        with foreign(name):
            cells = [_cells(values, key) for key, values in columns.items()]
            if len(set(map(len, cells))) > 1:
                said = (f"{key} {len(one)}" for key, one in zip(columns, cells, strict=True))
                raise InputError(f"the columns differ in length: {', '.join(said)}")
            count = len(cells[0]) if cells else 0
            sheet = ColumnSheet(
                Path(name),
                list(columns),
                lambda size: ([c[k : k + size] for c in cells] for k in range(0, count, size)),
                0,
            )
            sheet.name = name
            blocks = blocks_of(plan_of(sheet, FileWay(wanted)))
            (own,) = blocks.values()
            loop = loop_of(Found(name, name, tuple(own), named=True), wanted)
            found = longest_part(loop.parts)
    except InputError as error:
        what, fix = map(_as_arguments, (error.what, error.fix))
        raise InputError(what, where=error.where, fix=fix) from None
    return dataclasses.replace(found, notes=tuple(map(_as_arguments, found.notes)))


def _as_arguments(text: str) -> str:
    """Return advice of the command with arguments in place of options: ``op_unit share``."""
    said = re.sub(r"--auto\b", "automatic", _TAG_LISTS.sub("", text))
    return re.sub(r"--([a-z-]+)", lambda option: option[1].replace("-", "_"), said)


def _cells(values: Any, key: str) -> Cells:
    """Return a column as a file would give it: numbers, stamps, or texts, empty where missing."""
    found = np.asarray(values)
    if found.ndim != 1:
        raise InputError(f"has shape {found.shape}, not one value a row", where=key)
    if found.dtype.kind == "m":
        found = found / np.timedelta64(1, "s")
    if found.dtype.kind in "Mbiuf":
        return found if found.dtype.kind == "M" else found.astype(np.float64)
    texts = map(str, found.tolist())
    return ["" if text in EMPTY else text for text in texts]
