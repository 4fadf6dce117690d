"""A list that says which tags make up which loop, and how single files are read."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from stiction_ros.errors import InputError, foreign
from stiction_ros.intake.intake_options import (
    CsvColumns,
    IntakeOptions,
    OpUnit,
    known_op_unit,
    known_time_unit,
)
from stiction_ros.intake.sheets.cells import as_text, number
from stiction_ros.intake.sheets.names import SIGNALS, Tag, folded, read_tag
from stiction_ros.intake.sheets.stamps import DateOrder
from stiction_ros.intake.sheets.typed import open_sheets
from stiction_ros.intake.words import WORDS

LONGEST = 1e9  # sample time that is none any more, s


@dataclasses.dataclass(frozen=True)
class TagRow:
    """A row of a tag list."""

    where: str  # list and line
    loop: str  # its name
    tags: tuple[tuple[str, str], ...]  # signal and tag of each that it names
    unit: OpUnit | None = None  # of OP; None where the row does not say it
    file: str = ""  # for which it counts alone, a name or the end of a path; empty for all
    # what it says of that file: a column ``time``, and fields of the options
    options: Mapping[str, object] = dataclasses.field(default_factory=dict)

    def names(self, path: Path) -> bool:
        """Tell whether the row is one of a file."""
        if not self.file.endswith(path.name):  # as most are
            return False
        wanted = _parts(self.file)
        return bool(wanted) and _parts(str(path.absolute()))[-len(wanted) :] == wanted


def list_rows(
    path: Path, known: Callable[[set[str]], bool], fix: str
) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the place of each row of a list, and its cells by the names of their columns.

    Raises:
        InputError: its columns are not those that are ``known``; ``fix`` says what helps.
    """
    sheet = open_sheets(path)[0]
    header = [name.casefold() for name in sheet.layout.header]
    if not known(set(header)):
        raise InputError(f"has the columns {', '.join(sheet.layout.given)}", fix=fix)
    # A list is text: what looks like the first row of numbers is not where it begins.
    sheet.header_once = True
    sheet.layout = dataclasses.replace(sheet.layout, first=sheet.layout.place + 1)
    for columns, lines in sheet.pieces():
        for line, *cells in zip(lines.tolist(), *map(as_text, columns), strict=True):
            row = dict(zip(header, map(str.strip, cells), strict=True))
            yield f"{path}: {sheet.row_word} {line}", row


def _is_tag_list(header: set[str]) -> bool:
    loop = not {"loop", "name"}.isdisjoint(header)
    return "file" in header or (loop and ({"pv", "op"} <= header or {"tag", "signal"} <= header))


def _row(cells: Mapping[str, str], where: str) -> TagRow:
    loop, file = cells.get("loop", cells.get("name", "")), cells.get("file", "")
    named: list[tuple[str, str]] = []
    if "pv" in cells and "op" in cells:
        named = [(signal, cells.get(signal, "")) for signal in WORDS["signals"]]
    elif "tag" in cells and "signal" in cells:
        signal = SIGNALS.get(cells["signal"].casefold())
        if signal is None:
            raise _unknown("signal", repr(cells["signal"]), WORDS["signals"], where)
        named = [(signal, cells["tag"])]
    tags = tuple((signal, tag) for signal, tag in named if tag)
    if file and tags and not loop:
        raise InputError("names tags and no loop", where=where, fix="name it in the column loop")
    word = cells.get("op_unit", cells.get("unit", ""))
    unit = known_op_unit(word)
    if word and unit is None:
        raise _unknown("unit", f"{word!r} of OP", OpUnit, where)
    options = _options(cells, where) if file else {}
    if file and not tags and unit is not None:
        options["op_unit"] = unit
    return TagRow(where, loop, tags if loop else (), unit, file, options)


def _options(cells: Mapping[str, str], where: str) -> dict[str, object]:
    """Return what a row says of its file."""
    found: dict[str, object] = {"time": cells["time"]} if cells.get("time") else {}
    for key, read, known in (
        ("dates", {order.value: order for order in DateOrder}.get, DateOrder),
        ("time_unit", known_time_unit, ("ms", "s", "min", "h", "days", "us", "ns")),
    ):
        if word := cells.get(key):
            found[key] = read(word)
            if found[key] is None:
                raise _unknown(key, word, known, where)
    if text := cells.get("sample_time"):
        step = number(text)
        if step is None or not 0.0 < step < LONGEST:
            raise InputError(f"sample_time {text} is none", where=where, fix="give it in s")
        found["sample_time"] = step
    return found


def _unknown(what: str, word: str, known: Iterable[str], where: str) -> InputError:
    return InputError(f"{what} {word} is unknown", where=where, fix=f"use {', '.join(known)}")


def _parts(path: str) -> list[str]:
    return [part for part in path.replace("\\", "/").split("/") if part not in ("", ".")]


@dataclasses.dataclass(frozen=True)
class FileWay:
    """How one file is read: what a tag list says of it before what is said of all."""

    options: IntakeOptions
    # loop and signal of each tag in small letters; None finds them by the names
    tags: Mapping[str, Tag] | None = None
    own: Mapping[str, str] = dataclasses.field(default_factory=dict)  # tags that its rows name
    units: Mapping[str, OpUnit] = dataclasses.field(default_factory=dict)  # of OP, by its rows
    listed: Mapping[str, OpUnit] = dataclasses.field(default_factory=dict)  # of OP, by all others

    def read(self, name: str) -> Tag | None:
        """Return what a tag or the name of a column says, None when it says nothing."""
        return read_tag(name) if self.tags is None else self.tags.get(folded(name))

    def op_unit(self, loop: str) -> OpUnit | None:
        """Return the unit of OP that is said of a loop; None takes it from the export."""
        return self.units.get(loop) or self.options.op_unit or self.listed.get(loop)


@dataclasses.dataclass(frozen=True)
class TagList:
    """Which tags make up which loop."""

    loops: Mapping[str, Tag]  # name of the loop, signal, for each tag in small letters
    units: Mapping[str, OpUnit]  # unit of OP of loops of which the list says it
    rows: Sequence[TagRow]  # rows for one file alone

    def way_of(self, path: Path, options: IntakeOptions) -> FileWay:
        """Return how a file is read; InputError if its rows contradict each other."""
        rows = self._rows_of(path)
        said: dict[str, Any] = {}
        for row in rows:
            for key, value in row.options.items():
                if said.setdefault(key, value) != value:
                    raise InputError(
                        f"{key} of {row.file} is {value} here and {said[key]} above",
                        where=row.where,
                        fix="say one of them",
                    )
        own = {folded(tag): tag for row in rows for _, tag in row.tags}
        columns = CsvColumns() if own else options.columns
        columns = dataclasses.replace(columns, time=said.pop("time", options.columns.time))
        options = dataclasses.replace(options, columns=columns, **said)
        units = {row.loop: row.unit for row in rows if row.loop and row.unit is not None}
        tags = {**self.loops, **_by_tag(rows)}
        return FileWay(options, tags if tags or self.units else None, own, units, self.units)

    def _rows_of(self, path: Path) -> list[TagRow]:
        """Return the rows that count for one file alone."""
        return [row for row in self.rows if row.names(path)]

    def refuse_ambiguous(self, files: Sequence[Path]) -> None:
        """Raise an :class:`InputError` where a row names several files."""
        taken: dict[str, Path] = {}
        for file in files:
            for row in self._rows_of(file):
                if taken.setdefault(row.where, file) != file:
                    raise InputError(
                        f"{row.file} may be {taken[row.where]} or {file}",
                        where=row.where,
                        fix="write more of its path in the column file",
                    )

    def strange(self, files: Sequence[Path]) -> list[str]:
        """Return the files of rows that are none of ``files``."""
        there = {row.file for file in files for row in self._rows_of(file)}
        return [file for file in dict.fromkeys(row.file for row in self.rows) if file not in there]


def read_tag_list(path: Path | None) -> TagList:
    """Read a table with a row a loop (``loop,pv,sp,op,mode``) or a tag (``tag,loop,signal``).

    A column ``op_unit`` may say ``percent``, ``share`` or ``ma``. A row with a ``file`` counts
    for that file alone, and may have ``time``, ``dates``, ``time_unit`` and ``sample_time``. No
    ``path`` is a list without rows.
    """
    if path is None:
        return TagList({}, {}, [])
    fix = "a tag list has the columns loop,pv,sp,op,mode with a row a loop, or tag,loop,signal"
    with foreign(path):
        rows = [_row(cells, where) for where, cells in list_rows(path, _is_tag_list, fix)]
    general = [row for row in rows if not row.file]
    units = {row.loop: row.unit for row in general if row.unit is not None}
    return TagList(_by_tag(general), units, [row for row in rows if row.file])


def _by_tag(rows: Sequence[TagRow]) -> dict[str, Tag]:
    found: dict[str, Tag] = {}
    for row in rows:
        for signal, tag in row.tags:
            told = Tag(row.loop, signal)
            if found.setdefault(folded(tag), told) != told:
                fix = "list it once" if row.file else "list it once, or with the file of each"
                raise InputError(f"tag {tag} is there twice", where=row.where, fix=fix)
    return found
