"""Rows of a tag list."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import OpUnit, known_time_unit, op_unit
from stiction_ros.intake.sheets.cells import Words, number
from stiction_ros.intake.sheets.names import SIGNAL_WORDS, SIGNALS
from stiction_ros.intake.sheets.sheet import Sheet
from stiction_ros.intake.sheets.stamps import DateOrder
from stiction_ros.intake.sheets.typed import open_sheets

LONGEST = 1e9
"""Sample time that is none any more, s."""


@dataclasses.dataclass(frozen=True)
class TagRow:
    """A row of a tag list.

    Attributes:
        where: list and line.
        loop: its name.
        tags: signal and tag of each that it names.
        unit: of OP; None where the row does not say it.
        file: for which it counts alone, a name or the end of a path; empty for all.
        options: what it says of that file: a column ``time``, and fields of the options.
    """

    where: str
    loop: str
    tags: tuple[tuple[str, str], ...]
    unit: OpUnit | None = None
    file: str = ""
    options: Mapping[str, object] = dataclasses.field(default_factory=dict)

    @property
    def file_name(self) -> str:
        """Name of the file without its folders."""
        return _parts(self.file)[-1] if _parts(self.file) else ""

    def names(self, path: Path) -> bool:
        """Tell whether the row is one of a file."""
        wanted = _parts(self.file)
        return bool(wanted) and _parts(str(path.absolute()))[-len(wanted) :] == wanted


def read_rows(path: Path) -> list[TagRow]:
    """Read the rows of a tag list.

    Raises:
        InputError: it cannot be read, has other columns, or a cell that says nothing known.
    """
    sheet = open_sheets(path)[0]
    header = {name.casefold() for name in sheet.layout.header}
    loop = header & {"loop", "name"}
    known = (loop and {"pv", "op"} <= header) or (loop and {"tag", "signal"} <= header)
    if not known and "file" not in header:
        raise InputError(
            f"has the columns {', '.join(sheet.layout.given)}",
            where=str(path),
            fix="a tag list has the columns loop,pv,sp,op,mode with a row a loop, or "
            "tag,loop,signal",
        )
    return [_row(cells, where) for where, cells in _cells(sheet)]


def _cells(sheet: Sheet) -> list[tuple[str, dict[str, str]]]:
    """Return place and cells of each row by the names of their columns, in small letters."""
    # A list is text: what looks like the first row of numbers is not where it begins.
    sheet.header_once = True
    sheet.layout = dataclasses.replace(sheet.layout, first=sheet.layout.place + 1)
    header = [name.casefold() for name in sheet.layout.header]
    words = [Words() for _ in header]
    lines: list[int] = []
    for piece in sheet.pieces():
        lines.extend(np.asarray(piece.lines).tolist())
        for column, cells in zip(words, piece.columns, strict=True):
            column.add(cells)
    table = [[list(w.known)[code].strip() for code in w.codes().tolist()] for w in words]
    return [
        (f"{sheet.path}: {sheet.row_word} {line}", dict(zip(header, cells, strict=True)))
        for line, cells in zip(lines, zip(*table, strict=True), strict=True)
    ]


def _row(cells: Mapping[str, str], where: str) -> TagRow:
    loop, file = cells.get("loop", cells.get("name", "")), cells.get("file", "")
    if "pv" in cells and "op" in cells:
        named = [(signal, cells.get(signal, "")) for signal in SIGNAL_WORDS]
    elif "tag" in cells and "signal" in cells:
        named = [(_known(cells["signal"], where), cells["tag"])]
    else:
        named = []
    tags = tuple((signal, tag) for signal, tag in named if tag)
    if file and tags and not loop:
        raise InputError("names tags and no loop", where=where, fix="name it in the column loop")
    word = cells.get("op_unit", cells.get("unit", ""))
    unit = op_unit(word, where) if word else None
    options = _options(cells, where) if file else {}
    if file and not loop and unit is not None:
        options["op_unit"] = unit
    return TagRow(where, loop, tags if loop else (), unit, file, options)


def _options(cells: Mapping[str, str], where: str) -> dict[str, object]:
    """Return what a row says of its file."""
    found: dict[str, object] = {}
    if time := cells.get("time"):
        found["time"] = time
    if dates := cells.get("dates"):
        if dates not in tuple(DateOrder):
            raise _unknown("dates", dates, where, tuple(DateOrder))
        found["dates"] = DateOrder(dates)
    if word := cells.get("time_unit"):
        unit = known_time_unit(word)
        if unit is None:
            raise _unknown("time_unit", word, where, ("ms", "s", "min", "h", "days", "us", "ns"))
        found["time_unit"] = unit
    if text := cells.get("sample_time"):
        step = number(text)
        if step is None or not 0.0 < step < LONGEST:
            raise InputError(f"sample_time {text} is none", where=where, fix="give it in s")
        found["sample_time"] = step
    return found


def _known(word: str, where: str) -> str:
    signal = SIGNALS.get(word.casefold())
    if signal is None:
        raise _unknown("signal", repr(word), where, tuple(SIGNAL_WORDS))
    return signal


def _unknown(what: str, word: str, where: str, known: Sequence[str]) -> InputError:
    return InputError(f"{what} {word} is unknown", where=where, fix=f"use {', '.join(known)}")


def _parts(path: str) -> list[str]:
    return [part for part in path.replace("\\", "/").split("/") if part not in ("", ".")]
