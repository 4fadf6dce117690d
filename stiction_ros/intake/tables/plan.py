"""What the columns of a table are: one loop, many side by side, or one value a row."""

import dataclasses
import re
import shlex
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import IntakeOptions
from stiction_ros.intake.sheets import names as tag_names
from stiction_ros.intake.sheets.cells import Cells, Numbers, Words
from stiction_ros.intake.sheets.names import OR_ROW, VALUE_NAMES, Tag, folded, read_tag
from stiction_ros.intake.sheets.sheet import Sheet, stem
from stiction_ros.intake.tables.block import Key
from stiction_ros.intake.tables.clock import (
    ROWS_APART,
    TimeColumn,
    is_clock,
    kind_of,
    repeats,
    time_column,
)
from stiction_ros.intake.tables.qualities import qualities_of, quality_places
from stiction_ros.intake.tables.tags import FileWay
from stiction_ros.records.csv_writer import DEFAULT_OUTPUT, DEFAULT_VALVE, tagged_columns

LOOKED_AT = 1000  # rows by which it is told what stands in a column


class OneValue(NamedTuple):
    """Columns of a table with one value a row; ``unit`` where there is one."""

    tag: int
    time: TimeColumn
    value: int
    unit: int | None


def one_value(sheet: Sheet, way: FileWay, top: Sequence[Cells]) -> OneValue | None:
    """Return the columns of a table with one value a row; None for another table.

    It is told by the names of its columns or, where none of them is OP or PV, by what stands
    there: texts that name signals, stamps, numbers; refused where several may hold the values.
    """
    options, read = way.options, way.read
    named = options.columns.time
    unit = _first(sheet, tag_names.UNIT_NAMES)
    if options.long is not None:
        tag, time, value = (sheet.column(name, "--long TAG,TIME,VALUE") for name in options.long)
        return OneValue(tag, TimeColumn(time), value, unit)
    usual = _first(sheet, tag_names.TAG_NAMES), _first(sheet, tag_names.VALUE_NAMES)
    if usual[0] is not None and usual[1] is not None and usual[0] != usual[1]:
        return OneValue(usual[0], time_column(sheet, named), usual[1], unit)
    header = sheet.layout.header
    if any(told.loop or told.signal in ("op", "pv") for told in map(read, header) if told):
        return None
    kinds = list(map(kind_of, top))
    beside = {unit, *quality_places(header, top)}
    texts = [k for k, kind in enumerate(kinds) if kind == "text" and repeats(top[k])]
    texts = [k for k in texts if k not in beside]
    stamps = [k for k, cells in enumerate(top) if is_clock(header[k], cells)]
    stamps = [k for k in stamps if len(top[k]) < 2 or len(set(top[k])) > 1]
    of_tags = [k for k in texts if any(t.loop for t in map(read, set(top[k])) if t)]
    if not stamps or (not of_tags and (len(texts) != 1 or read(sheet.name))):
        return None
    listed = any(header[k].casefold() in tag_names.TIME_NAMES for k in stamps)
    clock = time_column(sheet, named) if named or listed else TimeColumn(stamps[0])
    place = (of_tags or texts)[0]
    other = beside | {clock.place}
    values = [k for k, kind in enumerate(kinds) if kind == "number" and k not in other]
    values = [k for k in values if not _is_count(top[k], top[place])] or values
    values = [k for k in values if _is_value(header[k])] or values
    if len(values) == 1:
        return OneValue(place, clock, values[0], unit)
    if not of_tags or not values:
        return None
    given = sheet.layout.given
    raise InputError(
        f"holds one value a row, in one of the columns {', '.join(given[k] for k in values)}",
        fix=f"say which with --long TAG,TIME,VALUE, such as --long "
        f"{shlex.quote(','.join(given[k] for k in (place, clock.place, values[0])))}",
    )


def _is_count(cells: Cells, names: Cells) -> bool:
    """Return whether numbers stand still, or never fall within a tag, as times do."""
    read, words = Numbers(decimal_comma=True), Words()
    read.add(cells)
    words.add(names)
    order = np.argsort(words.codes(), kind="stable")
    same = np.diff(words.codes()[order]) == 0
    return not np.any(np.diff(read.values()[order])[same] < 0.0)


def _is_value(name: str) -> bool:
    """Return whether a part of a name says value: ``VarValue``, ``IP_TREND_VALUE``."""
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^\W\d_A-Z]+", name)
    return any(part.casefold() in tag_names.VALUE_NAMES for part in parts)


def _first(sheet: Sheet, names: tuple[str, ...]) -> int | None:
    header = [name.casefold() for name in sheet.layout.header]
    return next((header.index(name) for name in names if name in header), None)


@dataclasses.dataclass(frozen=True)
class Plan:
    """Which column of a table is what."""

    sheet: Sheet  # the table
    way: FileWay  # how its file is read
    single: bool  # whether the table holds one loop, whose signals have names of no loop
    time: TimeColumn  # column of the times; its place is -1 where rows are a sample time apart
    loops: Mapping[str, Mapping[Key, int]]  # loop to its signals' columns; empty for a long table
    own: Mapping[int, TimeColumn] = dataclasses.field(default_factory=dict)  # where not of all
    # column of a signal to the columns of its quality
    quality: Mapping[int, tuple[int, ...]] = dataclasses.field(default_factory=dict)
    whole_quality: tuple[int, ...] = ()  # columns with the quality of whole rows
    long: OneValue | None = None  # columns of a table with one value a row
    named: bool = False  # whether the user named the columns
    notes: tuple[str, ...] = ()  # what was left out


def plan_of(sheet: Sheet, way: FileWay) -> Plan:
    """Return what the columns of a table are; InputError for missing or repeated ones."""
    empty: Sequence[Cells] = [[] for _ in sheet.layout.header]
    top = next((columns for columns, _ in sheet.pieces(LOOKED_AT)), empty)
    options = way.options
    if options.long is None and (options.columns.op or options.columns.pv):
        return _one_loop(sheet, way, top)
    long = one_value(sheet, way, top)
    if long is not None:
        taken = {long.tag, *long.time, long.value, long.unit}
        whole = tuple(quality_places(sheet.layout.header, top, taken))
        named = bool(way.own)
        return Plan(sheet, way, False, long.time, {}, whole_quality=whole, long=long, named=named)
    written = tagged_columns(sheet.layout.given)
    if written and way.tags is None and set(written["op"]) != set(written["pv"]):
        return _one_loop(sheet, way, top)
    return _wide(sheet, way, top) or _one_loop(sheet, way, top)


def _one_loop(sheet: Sheet, way: FileWay, top: Sequence[Cells]) -> Plan:
    """Return the plan of a file of one loop, by the names given or the usual ones."""
    options, columns = way.options, way.options.columns
    written = tagged_columns(sheet.layout.given)
    op = columns.op or written.get("op") or {DEFAULT_VALVE: _usual(sheet, "op") or "OP"}
    pv = columns.pv or written.get("pv") or {DEFAULT_OUTPUT: _usual(sheet, "pv") or "PV"}
    sp, stem = columns.sp, columns.stem
    if sp is None and columns.pv is None:
        name = _usual(sheet, "sp")
        sp = written.get("sp", {DEFAULT_OUTPUT: name} if name else {})
    if stem is None and columns.op is None:
        name = _usual(sheet, "stem")
        stem = written.get("stem", {DEFAULT_VALVE: name} if name else {})
    for option, part, whole in (("--sp", sp, pv), ("--stem", stem, op)):
        if part and set(part) != set(whole):
            raise InputError(
                f"{option} names {', '.join(sorted(part))}",
                fix=f"it needs one column for each of {', '.join(whole)}",
            )
    _refuse_missing(sheet, op.values(), pv.values(), options, top)
    chosen: dict[Key, int] = {}
    for signal, mapping in (("op", op), ("pv", pv), ("sp", sp), ("stem", stem)):
        for tag, column in (mapping or {}).items():
            chosen[Key(signal, tag)] = sheet.column(column, f"--{signal} TAG=COLUMN")
    clocks = _clocks(sheet, chosen.values(), options, top)
    name = _usual(sheet, "mode")
    mode = None if name is None else sheet.find(name)
    if mode is not None and mode not in chosen.values() and mode != clocks.time.place:
        chosen[Key("mode", "")] = mode
    named = bool(columns.op and columns.pv) or bool(written)
    return _plan(sheet, way, top, {sheet.name: chosen}, clocks, single=True, named=named)


class _Clocks(NamedTuple):
    time: TimeColumn
    own: Mapping[int, TimeColumn] = {}
    notes: Sequence[str] = ()


def _clocks(
    sheet: Sheet, signals: Iterable[int], options: IntakeOptions, top: Sequence[Cells]
) -> _Clocks:
    """Return the column of times, those that stand beside each signal, and notes."""
    named, given = options.columns.time, sheet.layout.given
    clocks = [k for k, cells in enumerate(top) if is_clock(sheet.layout.header[k], cells)]
    own = _own_times(clocks, sorted(signals), top)
    told = ", ".join(
        f"{given[k]} in column {clock.place + 1} {given[clock.place]}" for k, clock in own.items()
    )
    if own and named is None:
        note = f"signals have times of their own: {told}"
        return _Clocks(next(iter(own.values())), own, [note])
    try:
        note = f"all times are those of {named}, not {told}"
        return _Clocks(time_column(sheet, named), notes=[note] if own else ())
    except InputError:
        if named or clocks:
            raise
    if options.sample_time is None:
        raise InputError(
            "has no column t",
            fix=f"{sheet.columns_said}; choose with --time COLUMN, or with --sample-time S say "
            f"that its rows are S seconds apart {OR_ROW}",
        )
    note = f"no column holds a time: rows are taken {options.sample_time:g} s apart"
    return _Clocks(ROWS_APART, notes=[note])


def _own_times(
    clocks: Sequence[int], signals: Sequence[int], top: Sequence[Cells]
) -> dict[int, TimeColumn]:
    """Return the column of times beside each signal; none where one column is of all."""
    if not signals or len(clocks) < 2:
        return {}
    before, own = clocks[0] < signals[0], {}
    for signal in signals:
        near = [clock for clock in clocks if (clock < signal) == before]
        if not near:
            return {}
        place = near[-1] if before else near[0]
        dated = place - 1 in clocks and not re.search(r":\d", str(top[place - 1][0]))
        clocked = re.match(r"\s*\d+:\d", str(top[place][0]))
        own[signal] = TimeColumn(place - 1, place) if dated and clocked else TimeColumn(place)
    return own if len(set(own.values())) > 1 else {}


def _refuse_missing(
    sheet: Sheet, op: Iterable[str], pv: Iterable[str], options: IntakeOptions, top: Sequence[Cells]
) -> None:
    """Raise where several of OP, PV and the time are missing, with all that is to be said."""
    wanted = [("op", name) for name in op] + [("pv", name) for name in pv]
    missing = [
        (f"--{signal} TAG=COLUMN", name) for signal, name in wanted if sheet.find(name) is None
    ]
    if not missing:
        return
    there = [k for _, name in wanted if (k := sheet.find(name)) is not None]
    try:
        _clocks(sheet, there, options, top)
    except InputError:
        missing.append(("--time COLUMN", options.columns.time or "t"))
    if len(missing) > 1:
        choices, names = zip(*missing, strict=True)
        raise InputError(
            f"has no columns {', '.join(names[:-1])} and {names[-1]}",
            fix=f"{sheet.columns_said}; choose with {' '.join(choices)} [--sp TAG=COLUMN] "
            f"{OR_ROW}; where each row holds one value of a tag, with --long TAG,TIME,VALUE",
        )


def _usual(sheet: Sheet, signal: str) -> str | None:
    """Return the column of a signal: the usual one, or one that means the same; None for none."""
    if sheet.find(signal.upper()) is not None:
        return signal.upper()
    return next((n for n in sheet.layout.header if read_tag(n) == Tag("", signal)), None)


def _wide(sheet: Sheet, way: FileWay, top: Sequence[Cells]) -> Plan | None:
    """Return the plan of a table whose columns are tags; None when none is."""
    loops: dict[str, dict[Key, int]] = {}
    notes: list[str] = []
    for index, given in enumerate(sheet.layout.given):
        bare = sheet.layout.header[index]
        tag = way.read(bare) if way.tags is None else way.read(given) or way.read(bare)
        if tag is None and bare.casefold() in VALUE_NAMES:
            tag = way.read(sheet.name)
        if tag is None or not tag.loop or tag.quality:
            continue
        first = loops.setdefault(tag.loop, {}).setdefault(Key.of(tag), index)
        if first != index:
            said = f"{tag.signal.upper()} of {tag.loop} is {sheet.layout.given[first]}"
            notes.append(f"{given} is left out: {said}")
    _refuse_strange(sheet, way.own)
    if not loops:
        return None
    places = [index for signals in loops.values() for index in signals.values()]
    time = way.options.columns.time
    taken = {*places, None if time is None else sheet.find(time)}
    notes += _without_loop(sheet, loops, taken)
    places = [index for signals in loops.values() for index in signals.values()]
    clocks = _clocks(sheet, places, way.options, top)
    clocks = clocks._replace(notes=(*notes, *clocks.notes))
    return _plan(sheet, way, top, loops, clocks, single=False, named=bool(way.own))


def _plan(
    sheet: Sheet,
    way: FileWay,
    top: Sequence[Cells],
    loops: Mapping[str, Mapping[Key, int]],
    clocks: _Clocks,
    *,
    single: bool,
    named: bool,
) -> Plan:
    """Return a plan of signals side by side, with the columns of their qualities."""
    places = {index for signals in loops.values() for index in signals.values()}
    time, own, notes = clocks
    of_time = {place for clock in (time, *own.values()) for place in clock}
    beside, whole = qualities_of(sheet.layout.header, top, places, of_time)
    found = Plan(sheet, way, single, time, loops, own, beside, whole)
    return dataclasses.replace(found, named=named, notes=tuple(notes))


def _without_loop(
    sheet: Sheet, loops: dict[str, dict[Key, int]], taken: Collection[int | None]
) -> list[str]:
    """Give columns as a bare MODE to the one loop that there is; of several, return notes."""
    notes = []
    for index, name in enumerate(sheet.layout.header):
        tag = read_tag(name)
        if tag is None or tag.loop or tag.quality or index in taken:
            continue
        if len(loops) > 1:
            given = sheet.layout.given[index]
            notes.append(f"{given} is left out: it names none of the {len(loops)} loops")
            continue
        ((loop, signals),) = loops.items()
        signals.setdefault(Key.of(tag._replace(loop=loop)), index)
    return notes


def _refuse_strange(sheet: Sheet, own: Mapping[str, str]) -> None:
    """Raise where rows for this file name what is none of its columns; sheets share theirs."""
    known = set(map(folded, (*sheet.layout.given, *sheet.layout.header, sheet.name)))
    strange = [tag for key, tag in own.items() if key not in known]
    if strange and sheet.name == stem(sheet.path):
        raise InputError(
            f"has no column {' and no '.join(strange)}",
            fix=f"{sheet.columns_said}; correct its row in --tags",
        )
