"""What the columns of a table are: one loop, many side by side, or one value a row."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Mapping

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import CsvColumns, IntakeOptions
from stiction_ros.intake.sheets.names import (
    OR_ROW,
    QUALITY_NAMES,
    TAG_NAMES,
    UNIT_NAMES,
    VALUE_NAMES,
    Tag,
    read_tag,
)
from stiction_ros.intake.sheets.sheet import Sheet, stem
from stiction_ros.intake.tables.block import Key
from stiction_ros.intake.tables.clock import TimeColumn, time_column
from stiction_ros.intake.tables.tags import TagList
from stiction_ros.records.csv_names import DEFAULT_OUTPUT, DEFAULT_VALVE, tagged_columns

OPTIONS = {"op": "--op TAG=COLUMN", "pv": "--pv TAG=COLUMN", "sp": "--sp TAG=COLUMN"}


class Shape(enum.Enum):
    """How a table holds loops."""

    ONE = enum.auto()
    WIDE = enum.auto()
    LONG = enum.auto()


@dataclasses.dataclass(frozen=True)
class Plan:
    """Which column is what.

    Attributes:
        shape: of the table.
        time: column of the times.
        loops: name of each loop to its signals' columns; of a long table empty.
        quality: column of a signal to the column of its quality.
        whole_quality: column with the quality of whole rows.
        tag, value, unit: columns of a long table.
        named: whether the user named the columns.
        notes: what was left out.
    """

    shape: Shape
    time: TimeColumn
    loops: Mapping[str, Mapping[Key, int]]
    quality: Mapping[int, int] = dataclasses.field(default_factory=dict)
    whole_quality: int | None = None
    tag: int = -1
    value: int = -1
    unit: int | None = None
    named: bool = False
    notes: tuple[str, ...] = ()


def plan_of(sheet: Sheet, options: IntakeOptions, tags: TagList | None) -> Plan:
    """Return what the columns of a table are.

    Raises:
        InputError: a column is missing or there twice, or the options do not fit.
    """
    columns = options.columns
    if columns.op or columns.pv or options.as_given:
        return _one_loop(sheet, columns)
    long = _first(sheet, TAG_NAMES), _first(sheet, VALUE_NAMES)
    if long[0] is not None and long[1] is not None and long[0] != long[1]:
        time = time_column(sheet, columns.time)
        return Plan(
            Shape.LONG,
            time,
            {},
            whole_quality=_first(sheet, QUALITY_NAMES),
            tag=long[0],
            value=long[1],
            unit=_first(sheet, UNIT_NAMES),
            named=tags is not None and bool(tags.own),
        )
    written = tagged_columns(sheet.layout.given)
    if written and (len(written["op"]) == 1 or set(written["op"]) != set(written["pv"])):
        single = len(written["op"]) == 1 and list(written["op"]) == list(written["pv"])
        if not single and tags is None:
            return _one_loop(sheet, columns)
    wide = _wide(sheet, columns, tags)
    if wide is not None:
        return wide
    return _one_loop(sheet, columns)


def _one_loop(sheet: Sheet, columns: CsvColumns) -> Plan:
    """Return the plan of a file of one loop, by the names given or the usual ones."""
    written = tagged_columns(sheet.layout.given)
    op = columns.op or written.get("op") or {DEFAULT_VALVE: _usual(sheet, "op")}
    pv = columns.pv or written.get("pv") or {DEFAULT_OUTPUT: _usual(sheet, "pv")}
    sp, stem = columns.sp, columns.stem
    if sp is None and columns.pv is None:
        name = _usual(sheet, "sp")
        plain = {DEFAULT_OUTPUT: name} if sheet.find(name) is not None else None
        sp = written.get("sp", plain)
    if stem is None and columns.op is None:
        name = _usual(sheet, "stem")
        plain = {DEFAULT_VALVE: name} if sheet.find(name) is not None else None
        stem = written.get("stem", plain)
    _same_tags(sp, pv, "--sp", sheet)
    _same_tags(stem, op, "--stem", sheet)
    _refuse_missing(sheet, [*op.values()], [*pv.values()], columns.time)
    time = time_column(sheet, columns.time)
    chosen: dict[Key, int] = {}
    for signal, mapping in (("op", op), ("pv", pv), ("sp", sp), ("stem", stem)):
        for tag, column in (mapping or {}).items():
            chosen[Key(signal, tag)] = sheet.column(column, f"--{signal} TAG=COLUMN")
    mode = sheet.find(_usual(sheet, "mode"))
    if mode is not None and mode not in chosen.values() and mode != time.place:
        chosen[Key("mode", "")] = mode
    named = bool(columns.op and columns.pv) or bool(written)
    quality, whole = _qualities(sheet, set(chosen.values()))
    return Plan(Shape.ONE, time, {sheet.name: chosen}, quality, whole, named=named)


def _refuse_missing(sheet: Sheet, op: list[str], pv: list[str], time: str | None) -> None:
    """Raise where several of OP, PV and the time are missing, with all that is to be said.

    Raises:
        InputError: two or more of them are missing.
    """
    wanted = [("op", name) for name in op] + [("pv", name) for name in pv]
    missing = [(signal, name) for signal, name in wanted if sheet.find(name) is None]
    options = [OPTIONS[signal] for signal, _ in missing]
    names = [name for _, name in missing]
    try:
        time_column(sheet, time)
    except InputError:
        names.append(time or "t")
        options.append("--time COLUMN")
    if len(names) > 1:
        raise InputError(
            f"has no columns {', '.join(names[:-1])} and {names[-1]}",
            where=str(sheet.path),
            fix=f"its columns are {', '.join(sheet.layout.given)}; choose with "
            f"{' '.join(options)} [--sp TAG=COLUMN] {OR_ROW}",
        )


def _usual(sheet: Sheet, signal: str) -> str:
    """Return the name of the column of a signal: the usual one, or one that means the same."""
    plain = signal.upper()
    if sheet.find(plain) is not None:
        return plain
    for name in sheet.layout.header:
        if read_tag(name) == Tag("", signal):
            return name
    return plain


def _wide(sheet: Sheet, columns: CsvColumns, tags: TagList | None) -> Plan | None:
    """Return the plan of a table whose columns are tags; None when none is."""
    loops: dict[str, dict[Key, int]] = {}
    quality: dict[Tag, int] = {}
    notes: list[str] = []
    for index, (given, bare) in enumerate(
        zip(sheet.layout.given, sheet.layout.header, strict=True)
    ):
        if tags is not None:
            tag = tags.read(given) or tags.read(bare)
            if tag is None and (told := read_tag(bare)) is not None and told.quality:
                tag = None
        else:
            tag = read_tag(bare)
        if tag is None and bare.casefold() in VALUE_NAMES:
            tag = tags.read(sheet.name) if tags is not None else read_tag(sheet.name)
        if tag is None or not tag.loop:
            continue
        if tag.quality:
            quality[tag] = index
            continue
        key = Key(tag.signal, "" if tag.signal == "mode" else tag.loop)
        signals = loops.setdefault(tag.loop, {})
        if key in signals:
            first = sheet.layout.given[signals[key]]
            notes.append(f"{given} is left out: {tag.signal.upper()} of {tag.loop} is {first}")
            continue
        signals[key] = index
    if tags is not None:
        _refuse_strange(sheet, tags)
    if not loops:
        return None
    time = time_column(sheet, columns.time)
    notes += _without_loop(sheet, loops, time.place)
    places = {index for signals in loops.values() for index in signals.values()}
    beside, whole = _qualities(sheet, places)
    for tag, index in quality.items():
        key = Key(tag.signal, "" if tag.signal == "mode" else tag.loop)
        if (of := loops.get(tag.loop, {}).get(key)) is not None:
            beside[of] = index
    named = tags is not None and bool(tags.own)
    return Plan(Shape.WIDE, time, loops, beside, whole, named=named, notes=tuple(notes))


def _without_loop(sheet: Sheet, loops: dict[str, dict[Key, int]], time: int | None) -> list[str]:
    """Give columns as a bare MODE to the one loop that there is; of several, return notes.

    Args:
        sheet: with columns of which some are tags.
        loops: columns of each loop, added to.
        time: place of the column of the time.
    """
    notes = []
    taken = {index for signals in loops.values() for index in signals.values()} | {time}
    for index, name in enumerate(sheet.layout.header):
        tag = read_tag(name)
        if tag is None or tag.loop or tag.quality or index in taken:
            continue
        if len(loops) > 1:
            given = sheet.layout.given[index]
            notes.append(f"{given} is left out: it names none of the {len(loops)} loops")
            continue
        ((loop, signals),) = loops.items()
        signals.setdefault(Key(tag.signal, "" if tag.signal == "mode" else loop), index)
    return notes


def _refuse_strange(sheet: Sheet, tags: TagList) -> None:
    """Raise where rows for this file name what is none of its columns; sheets share theirs.

    Raises:
        InputError: they do.
    """
    names = (*sheet.layout.given, *sheet.layout.header, sheet.name)
    known = {" ".join(name.split()).casefold() for name in names}
    strange = [tag for key, tag in tags.own.items() if key not in known]
    if strange and sheet.name == stem(sheet.path):
        raise InputError(
            f"has no column {' and no '.join(strange)}",
            where=str(sheet.path),
            fix=f"its columns are {', '.join(sheet.layout.given)}; correct its row in --tags",
        )


def _qualities(sheet: Sheet, signals: set[int]) -> tuple[dict[int, int], int | None]:
    """Return columns of qualities that stand behind each signal, or the one of whole rows."""
    names = [name.casefold() for name in sheet.layout.header]
    places = [index for index, name in enumerate(names) if name in QUALITY_NAMES]
    places = [index for index in places if index not in signals]
    if len(places) == 1 and len(signals) > 1:
        return {}, places[0]
    return {index - 1: index for index in places if index - 1 in signals}, None


def _first(sheet: Sheet, names: tuple[str, ...]) -> int | None:
    header = [name.casefold() for name in sheet.layout.header]
    return next((header.index(name) for name in names if name in header), None)


def _same_tags(
    part: Mapping[str, str] | None, whole: Mapping[str, str], option: str, sheet: Sheet
) -> None:
    if part and set(part) != set(whole):
        raise InputError(
            f"{option} names {', '.join(sorted(part))}",
            where=str(sheet.path),
            fix=f"it needs one column for each of {', '.join(whole)}",
        )
