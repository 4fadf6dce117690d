"""Rows of a tag list."""

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import OpUnit, known_op_unit, known_time_unit
from stiction_ros.intake.sheets.cells import as_text, number
from stiction_ros.intake.sheets.names import SIGNALS
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

    @property
    def file_name(self) -> str:
        """Name of the file without its folders."""
        return _parts(self.file)[-1] if _parts(self.file) else ""

    def names(self, path: Path) -> bool:
        """Tell whether the row is one of a file."""
        wanted = _parts(self.file)
        return bool(wanted) and _parts(str(path.absolute()))[-len(wanted) :] == wanted


def read_rows(path: Path) -> list[TagRow]:
    """Read the rows of a tag list; what says nothing known in it is an :class:`InputError`."""
    sheet = open_sheets(path)[0]
    header = [name.casefold() for name in sheet.layout.header]
    loop = not {"loop", "name"}.isdisjoint(header)
    known = loop and ({"pv", "op"} <= set(header) or {"tag", "signal"} <= set(header))
    if not known and "file" not in header:
        raise InputError(
            f"has the columns {', '.join(sheet.layout.given)}",
            fix="a tag list has the columns loop,pv,sp,op,mode with a row a loop, or "
            "tag,loop,signal",
        )
    # A list is text: what looks like the first row of numbers is not where it begins.
    sheet.header_once = True
    sheet.layout = dataclasses.replace(sheet.layout, first=sheet.layout.place + 1)
    found = []
    for columns, lines in sheet.pieces():
        for line, *cells in zip(lines.tolist(), *map(as_text, columns), strict=True):
            row = dict(zip(header, map(str.strip, cells), strict=True))
            found.append(_row(row, f"{path}: {sheet.row_word} {line}"))
    return found


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
    if file and not loop and unit is not None:
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
