"""What the columns of a table are: one loop, many side by side, or one value a row."""

from __future__ import annotations

import dataclasses
import enum
import re
import shlex
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import IntakeOptions
from stiction_ros.intake.sheets.cells import Cells, Numbers, Words, is_number
from stiction_ros.intake.sheets.names import (
    OR_ROW,
    TAG_NAMES,
    TIME_NAMES,
    UNIT_NAMES,
    VALUE_NAMES,
    Tag,
    quality_kind,
    read_tag,
    without_quality,
)
from stiction_ros.intake.sheets.sheet import Sheet, stem
from stiction_ros.intake.sheets.stamps import is_stamp
from stiction_ros.intake.tables.block import Key
from stiction_ros.intake.tables.clock import ROWS_APART, TimeColumn, time_column
from stiction_ros.intake.tables.qualities import all_of_quality
from stiction_ros.intake.tables.tags import TagList
from stiction_ros.records.csv_names import DEFAULT_OUTPUT, DEFAULT_VALVE, tagged_columns

LOOKED_AT = 1000
"""Rows by which it is told what stands in a column."""

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
        time: column of the times; its place is -1 where rows are a sample time apart.
        own: column of a signal to its own column of times, empty where one is of all.
        loops: name of each loop to its signals' columns; of a long table empty.
        quality: column of a signal to the columns of its quality.
        whole_quality: columns with the quality of whole rows.
        tag, value, unit: columns of a long table.
        named: whether the user named the columns.
        notes: what was left out.
    """

    shape: Shape
    time: TimeColumn
    loops: Mapping[str, Mapping[Key, int]]
    own: Mapping[int, TimeColumn] = dataclasses.field(default_factory=dict)
    quality: Mapping[int, tuple[int, ...]] = dataclasses.field(default_factory=dict)
    whole_quality: tuple[int, ...] = ()
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
    empty: Sequence[Cells] = [[] for _ in sheet.layout.header]
    top = next((piece.columns for piece in sheet.pieces(LOOKED_AT)), empty)
    if options.long is None and (columns.op or columns.pv or options.as_given):
        return _one_loop(sheet, options, top)
    long = _long(sheet, options, tags, top)
    if long is not None:
        return long
    written = tagged_columns(sheet.layout.given)
    if written and (len(written["op"]) == 1 or set(written["op"]) != set(written["pv"])):
        single = len(written["op"]) == 1 and list(written["op"]) == list(written["pv"])
        if not single and tags is None:
            return _one_loop(sheet, options, top)
    return _wide(sheet, options, tags, top) or _one_loop(sheet, options, top)


def _long(
    sheet: Sheet, options: IntakeOptions, tags: TagList | None, top: Sequence[Cells]
) -> Plan | None:
    """Return the plan of a table with one value a row; None for another table.

    It is told by the names of its columns or, where none of them is OP or PV, by what stands
    there: texts that name signals, stamps, numbers.

    Raises:
        InputError: several columns may hold the values.
    """
    named = options.columns.time
    if options.long is not None:
        places = [sheet.column(name, "--long TAG,TIME,VALUE") for name in options.long]
        tag, time, value = places[0], TimeColumn(places[1]), places[2]
    else:
        usual = _first(sheet, TAG_NAMES), _first(sheet, VALUE_NAMES)
        if usual[0] is not None and usual[1] is not None and usual[0] != usual[1]:
            tag, value = usual[0], usual[1]
            time = time_column(sheet, named)
        else:
            found = _long_by_shape(sheet, named, tags, top)
            if found is None:
                return None
            tag, time, value = found
    unit = _first(sheet, UNIT_NAMES)
    taken = {tag, time.place, time.beside, value, unit}
    return Plan(
        Shape.LONG,
        time,
        {},
        whole_quality=tuple(_quality_places(sheet, taken, top)),
        tag=tag,
        value=value,
        unit=unit,
        named=tags is not None and bool(tags.own),
    )


def _long_by_shape(
    sheet: Sheet, named: str | None, tags: TagList | None, top: Sequence[Cells]
) -> tuple[int, TimeColumn, int] | None:
    """Return the columns of tag, time and value by what stands in them; None for another table."""
    header, read = sheet.layout.header, read_tag if tags is None else tags.read
    here = [told for told in map(read, header) if told is not None]
    if any(told.loop or told.signal in ("op", "pv") for told in here):
        return None
    kinds = [_kind(cells) for cells in top]
    beside = {_first(sheet, UNIT_NAMES), *_quality_places(sheet, (), top)}
    texts = [
        k for k, kind in enumerate(kinds) if kind == "text" and _repeats(top[k]) and k not in beside
    ]
    tag = next((k for k in texts if any(t.loop for t in map(read, set(top[k])) if t)), None)
    stamps = [k for k in range(len(top)) if _is_clock(header[k], top[k]) and not _still(top[k])]
    if not stamps or (tag is None and (len(texts) != 1 or read(sheet.name))):
        return None
    listed = [k for k in stamps if header[k].casefold() in TIME_NAMES]
    time = time_column(sheet, named) if named or listed else TimeColumn(stamps[0])
    place = texts[0] if tag is None else tag
    numbers = [k for k, kind in enumerate(kinds) if kind == "number" and k != time.place]
    values = [k for k in numbers if k not in beside]
    if len(values) > 1:
        values = [k for k in values if not _is_count(top[k], top[place])] or values
    if len(values) > 1:
        values = [k for k in values if _is_value(header[k])] or values
    if len(values) == 1:
        return place, time, values[0]
    if tag is None or not values:
        return None
    given = sheet.layout.given
    raise InputError(
        f"holds one value a row, in one of the columns {', '.join(given[k] for k in values)}",
        where=str(sheet.path),
        fix=f"say which with --long TAG,TIME,VALUE, such as --long "
        f"{shlex.quote(','.join(given[k] for k in (place, time.place, values[0])))}",
    )


def _kind(cells: Cells) -> str:
    """Return what most cells of a column are: stamp, number, text; empty when nothing is there."""
    if isinstance(cells, np.ndarray):
        return "stamp" if cells.dtype.kind == "M" else "number"
    counts = Counter(
        "stamp" if is_stamp(cell) else "number" if is_number(cell) else "text"
        for cell in cells[:: max(len(cells) // 100, 1)]
        if cell.strip()
    )
    return counts.most_common(1)[0][0] if counts else ""


def _repeats(cells: Cells) -> bool:
    return 2 * len(set(cells)) <= len(cells)


def _still(cells: Cells) -> bool:
    return len(cells) > 1 and len(set(cells)) == 1


def _is_count(cells: Cells, names: Cells) -> bool:
    """Return whether numbers stand still, or never fall within a tag, as times do."""
    read = Numbers(decimal_comma=True)
    read.add(cells)
    values, words = read.values(), Words()
    words.add(names)
    order = np.argsort(words.codes(), kind="stable")
    same = np.diff(words.codes()[order]) == 0
    return not np.any(np.diff(values[order])[same] < 0.0)


def _is_value(name: str) -> bool:
    """Return whether a part of a name says value: ``VarValue``, ``IP_TREND_VALUE``."""
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^\W\d_A-Z]+", name)
    return any(part.casefold() in VALUE_NAMES for part in parts)


def _one_loop(sheet: Sheet, options: IntakeOptions, top: Sequence[Cells]) -> Plan:
    """Return the plan of a file of one loop, by the names given or the usual ones."""
    columns = options.columns
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
    _refuse_missing(sheet, [*op.values()], [*pv.values()], options, top)
    chosen: dict[Key, int] = {}
    for signal, mapping in (("op", op), ("pv", pv), ("sp", sp), ("stem", stem)):
        for tag, column in (mapping or {}).items():
            place = sheet.column(column, f"--{signal} TAG=COLUMN")
            for key in (key for key, other in chosen.items() if other == place):
                if {key.signal, signal} - {"op", "pv"}:
                    continue
                raise InputError(
                    f"{column} is given twice, as {key.signal.upper()} {key.tag} and as "
                    f"{signal.upper()} {tag}",
                    where=str(sheet.path),
                    fix=f"name another column for one of them, its columns are "
                    f"{', '.join(sheet.layout.given)} {OR_ROW}",
                )
            chosen[Key(signal, tag)] = place
    time, own, notes = _times(sheet, chosen.values(), options, top)
    mode = sheet.find(_usual(sheet, "mode"))
    if mode is not None and mode not in chosen.values() and mode != time.place:
        chosen[Key("mode", "")] = mode
    named = bool(columns.op and columns.pv) or bool(written)
    clocks = {time.place, time.beside, *(clock.place for clock in own.values())}
    quality, whole = _qualities(sheet, set(chosen.values()), clocks, top)
    loops = {sheet.name: chosen}
    return Plan(Shape.ONE, time, loops, own, quality, whole, named=named, notes=tuple(notes))


def _times(
    sheet: Sheet, signals: Iterable[int], options: IntakeOptions, top: Sequence[Cells]
) -> tuple[TimeColumn, dict[int, TimeColumn], list[str]]:
    """Return the column of times, those that stand beside each signal, and notes.

    Raises:
        InputError: there is none, and no sample time is given.
    """
    named = options.columns.time
    clocks = [k for k, cells in enumerate(top) if _is_clock(sheet.layout.header[k], cells)]
    own, given = _own_times(clocks, sorted(signals), top), sheet.layout.given
    told = ", ".join(
        f"{given[k]} in column {clock.place + 1} {given[clock.place]}" for k, clock in own.items()
    )
    if own and named is None:
        return next(iter(own.values())), own, [f"signals have times of their own: {told}"]
    try:
        time = time_column(sheet, named)
        return time, {}, [f"all times are those of {named}, not {told}"] if own else []
    except InputError:
        if named or clocks:
            raise
        if options.sample_time is not None:
            note = f"no column holds a time: rows are taken {options.sample_time:g} s apart"
            return ROWS_APART, {}, [note]
        raise InputError(
            "has no column t",
            where=str(sheet.path),
            fix=f"its columns are {', '.join(sheet.layout.given)}; choose with --time COLUMN, or "
            f"with --sample-time S say that its rows are S seconds apart {OR_ROW}",
        ) from None


def _is_clock(name: str, cells: Cells) -> bool:
    """Return whether a column holds stamps, or numbers under the name of a time."""
    if (told := read_tag(name)) is not None and not told.quality:
        return False
    kind = _kind(cells)
    bare = re.sub(r"[\s._(#-]*\d*\)?$", "", name).casefold()
    return kind == "stamp" or (kind == "number" and bare in TIME_NAMES)


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
    sheet: Sheet, op: list[str], pv: list[str], options: IntakeOptions, top: Sequence[Cells]
) -> None:
    """Raise where several of OP, PV and the time are missing, with all that is to be said.

    Raises:
        InputError: two or more of them are missing.
    """
    wanted = [("op", name) for name in op] + [("pv", name) for name in pv]
    missing = [(signal, name) for signal, name in wanted if sheet.find(name) is None]
    choices = [OPTIONS[signal] for signal, _ in missing]
    names = [name for _, name in missing]
    try:
        _times(
            sheet, [k for _, name in wanted if (k := sheet.find(name)) is not None], options, top
        )
    except InputError:
        names.append(options.columns.time or "t")
        choices.append("--time COLUMN")
    if len(names) > 1:
        raise InputError(
            f"has no columns {', '.join(names[:-1])} and {names[-1]}",
            where=str(sheet.path),
            fix=f"its columns are {', '.join(sheet.layout.given)}; choose with "
            f"{' '.join(choices)} [--sp TAG=COLUMN] {OR_ROW}; where each row holds one value of "
            "a tag, with --long TAG,TIME,VALUE",
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


def _wide(
    sheet: Sheet, options: IntakeOptions, tags: TagList | None, top: Sequence[Cells]
) -> Plan | None:
    """Return the plan of a table whose columns are tags; None when none is."""
    loops: dict[str, dict[Key, int]] = {}
    notes: list[str] = []
    for index, (given, bare) in enumerate(
        zip(sheet.layout.given, sheet.layout.header, strict=True)
    ):
        tag = read_tag(bare) if tags is None else tags.read(given) or tags.read(bare)
        if tag is None and bare.casefold() in VALUE_NAMES:
            tag = tags.read(sheet.name) if tags is not None else read_tag(sheet.name)
        if tag is None or not tag.loop or tag.quality:
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
    places = {index for signals in loops.values() for index in signals.values()}
    time, _, _ = _times(sheet, places, options, top)
    notes += _without_loop(sheet, loops, time.place)
    places = {index for signals in loops.values() for index in signals.values()}
    time, own, told = _times(sheet, places, options, top)
    clocks = {time.place, time.beside, *(clock.place for clock in own.values())}
    beside, whole = _qualities(sheet, places, clocks, top)
    named = tags is not None and bool(tags.own)
    return Plan(Shape.WIDE, time, loops, own, beside, whole, named=named, notes=(*notes, *told))


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


def _qualities(
    sheet: Sheet, signals: set[int], taken: Collection[int | None], top: Sequence[Cells]
) -> tuple[dict[int, tuple[int, ...]], tuple[int, ...]]:
    """Return columns of qualities: those of each signal, and those of whole rows.

    One that names a signal is its; of several with one name each is of the signal before it.
    """
    header = sheet.layout.header
    places = _quality_places(sheet, {*signals, *taken}, top)
    plain = [re.sub(r"[\s._]*\d+$", "", name).casefold() for name in header]
    names = Counter(plain[k] for k in places)
    signal = {tag: k for k in signals if (tag := read_tag(header[k])) is not None}
    beside: dict[int, tuple[int, ...]] = {}
    whole: list[int] = []
    names_at = {_folded(name): k for k, name in enumerate(header) if k not in places}
    for place in places:
        named, of = read_tag(header[place]), names_at.get(_folded(without_quality(header[place])))
        if named is not None:
            of = signal.get(named._replace(quality=False), of)
        if of not in signals and (of is not None or (named is not None and named.loop)):
            continue  # of a signal that is none of these
        if of is None and (names[plain[place]] > 1 or len(signals) == 1):
            of = max((k for k in signals if k < place), default=None)
        if of is None:
            whole.append(place)
        else:
            beside[of] = (*beside.get(of, ()), place)
    return beside, tuple(whole)


def _quality_places(sheet: Sheet, taken: Collection[int | None], top: Sequence[Cells]) -> list[int]:
    """Return the columns that tell of qualities by their name or by the words in them."""
    return [
        index
        for index, (name, cells) in enumerate(zip(sheet.layout.header, top, strict=True))
        if index not in taken
        and (
            (quality_kind(name) is not None and _few(cells))
            or all_of_quality(set(cells) if not isinstance(cells, np.ndarray) else ())
        )
    ]


def _few(cells: Cells) -> bool:
    """Return whether cells are words, or whole numbers and shares of few kinds, as codes are."""
    return _kind(cells) in ("text", "") or _repeats(cells)


def _folded(name: str) -> str:
    return " ".join(name.split()).casefold()


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
