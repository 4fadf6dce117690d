"""Reads tables into blocks of signals, one loop each."""

import dataclasses
import itertools
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from stiction_ros.errors import InputError
from stiction_ros.intake.sheets.cells import Numbers, Words
from stiction_ros.intake.sheets.names import unit_in
from stiction_ros.intake.sheets.sheet import Sheet
from stiction_ros.intake.sheets.stamps import Clock, Stamps, Times, Wrong
from stiction_ros.intake.tables.block import Block, Column, FlagArray, Key
from stiction_ros.intake.tables.clock import ROWS_APART, TimeColumn, in_seconds
from stiction_ros.intake.tables.plan import OneValue, Plan
from stiction_ros.intake.tables.qualities import bad_qualities
from stiction_ros.records.csv_writer import QUALITY
from stiction_ros.records.record import QUALITY_WORDS, QualityArray

Reader = tuple[int, Numbers] | tuple[int, Words]


def blocks_of(plan: Plan) -> dict[str, list[Block]]:
    """Read a table into blocks, by the name of their loop."""
    return _beside(plan) if plan.long is None else _long(plan, plan.long)


def _beside(plan: Plan) -> dict[str, list[Block]]:
    """Read a table with one row a stamp: a block for each clock of a loop."""
    sheet = plan.sheet
    numbers: dict[int, Numbers] = {}
    words: dict[int, Words] = {}
    for signals in plan.loops.values():
        for key, index in signals.items():
            if key.signal == "mode":
                words[index] = Words()
            else:
                numbers[index] = Numbers(sheet.decimal_comma)
    for quality in itertools.chain(plan.whole_quality, *plan.quality.values()):
        words[quality] = Words()
    clocks = dict.fromkeys((plan.time, *plan.own.values()))
    lines, times = _read(plan, [*numbers.items(), *words.items()], clocks, least=2)
    alike = {clock: next(k for k in times if _same(times[k], times[clock])) for clock in times}
    mask, whole_bad, told = _whole_quality(plan, words)
    notes = [*plan.notes, *(time.note for time in times.values()), *told]
    found: dict[str, list[Block]] = {}
    for name, signals in plan.loops.items():
        of_clock: dict[TimeColumn, dict[Key, Column]] = {}
        said = list(notes)
        for key, index in signals.items():
            given = sheet.layout.given[index]
            if key.signal == "mode":
                column = _mode(given, words[index])
            else:
                beside = {k: words[k] for k in plan.quality.get(index, ())}
                bad, own = _bad_rows(sheet, beside, whole_bad)
                said += own
                unit = sheet.layout.units[index] or unit_in(given)
                read = numbers[index]
                counts = Counter(read.words.values())
                column = Column(given, read.values(), read.blank(), counts, unit)
                column = _without_bad(column, bad)
            of_clock.setdefault(alike[plan.own.get(index, plan.time)], {})[key] = column
        blocks = [
            _block(sheet, times[clock], lines, columns, said, mask)
            for clock, columns in of_clock.items()
        ]
        found[name] = list(map(_filled_rows, blocks)) if plan.own else blocks
    return found


def _long(plan: Plan, long: OneValue) -> dict[str, list[Block]]:
    """Read a table with one value a row: one block a tag."""
    sheet = plan.sheet
    names, units, values = Words(), Words(), Numbers(sheet.decimal_comma)
    quality = {index: Words() for index in plan.whole_quality}
    readers: list[Reader] = [(long.tag, names), (long.value, values), *quality.items()]
    if long.unit is not None:
        readers.append((long.unit, units))
    lines, times = _read(plan, readers, [plan.time], least=1)
    time, whole = times[plan.time], Column("", values.values(), values.blank())
    bad, notes = _bad_rows(sheet, quality)
    tag_codes = names.codes()
    unit_of = dict(zip(tag_codes.tolist(), units.codes().tolist(), strict=False))
    unit_words = list(units.known)
    order = np.argsort(tag_codes, kind="stable")
    edges = np.searchsorted(tag_codes[order], np.arange(len(names.known) + 1))
    found: dict[str, list[Block]] = {}
    for code, name in enumerate(names.known):
        tag = plan.way.read(name)
        if tag is None or not tag.loop or tag.quality:
            continue
        rows = order[edges[code] : edges[code + 1]]
        column, said = whole.rows(rows), [values.words.get(row, "") for row in rows.tolist()]
        if tag.signal == "mode":
            modes, told = Words(), zip(said, column.values.tolist(), strict=True)
            modes.add([word or ("" if value != value else f"{value:g}") for word, value in told])
            column = _mode(name, modes)
        else:
            words = Counter(filter(None, said))
            column = dataclasses.replace(column, name=name, words=words)
            column = _without_bad(column, None if bad is None else bad[rows])
        unit = unit_words[unit_of[code]].strip() if code in unit_of else ""
        column.unit = unit or unit_in(name)
        own = time._replace(seconds=time.seconds[rows])
        block = _block(sheet, own, lines[rows], {Key.of(tag): column}, [time.note, *notes])
        found.setdefault(tag.loop, []).append(block)
    return found


def _read(
    plan: Plan, readers: Sequence[Reader], clocks: Iterable[TimeColumn], *, least: int
) -> tuple[NDArray[np.int64], Mapping[TimeColumn, Times]]:
    """Read columns; return the lines of their rows, shape (N,), and the times of each clock."""
    sheet, options = plan.sheet, plan.way.options
    stamps = {clock: Stamps(sheet.decimal_comma, options.dates) for clock in clocks}
    lines: list[NDArray[np.int64]] = []
    for columns, place in sheet.pieces():
        for clock, read in stamps.items():
            if clock != ROWS_APART:
                read.add(clock.cells(columns))
        for index, reader in readers:
            reader.add(columns[index])
        lines.append(place)
    count = sum(map(len, lines))
    if count < least:
        said = f"has {count} row{'s' * (count != 1)} of data"
        raise InputError(said, fix="a record needs two at least")
    place, times = np.concatenate(lines), {}
    for clock, read in stamps.items():
        if clock == ROWS_APART:
            apart = (options.sample_time or 1.0) * np.arange(count, dtype=np.float64)
            times[clock] = Times(apart, Clock(0.0))
            continue
        found = in_seconds(read.times(), sheet, clock.place, options)
        if found.wrong is not None:
            name, row = sheet.layout.given[clock.place], found.wrong.row
            said = f"column {name} {found.wrong.said} in {sheet.row_word} {place[row]}"
            found = found._replace(wrong=Wrong(row, said))
        times[clock] = found
    return place, times


def _same(one: Times, other: Times) -> bool:
    alike = np.array_equal(one.seconds, other.seconds, equal_nan=True)
    return alike and one.clock == other.clock


def _block(
    sheet: Sheet,
    times: Times,
    lines: NDArray[np.int64],
    columns: dict[Key, Column],
    notes: Iterable[str],
    mask: QualityArray | None = None,
) -> Block:
    return Block(
        path=sheet.path,
        row_word=sheet.row_word,
        clock=times.clock,
        time=times.seconds,
        lines=lines,
        columns=columns,
        mask=mask,
        notes=tuple(dict.fromkeys(filter(None, notes))),
        stray="" if times.wrong is None else times.wrong.said,
        mended=tuple(sheet.mended),
    )


def _filled_rows(block: Block) -> Block:
    """Return the rows of signals with times of their own that hold a time or a value."""
    blank = np.all([column.blank for column in block.columns.values()], axis=0)
    return block.rows(np.isfinite(block.time) | ~blank)


def _mode(name: str, read: Words) -> Column:
    known = tuple(word.strip() for word in read.known)
    blank = read.where({word for word in read.known if not word.strip()})
    return Column(name, read.codes().astype(np.float64), blank, known=known)


def _without_bad(column: Column, bad: FlagArray | None) -> Column:
    """Return a column without the values of rows of bad quality, which its words count."""
    if bad is None or not bad.any():
        return column
    words = column.words.copy()
    words["of bad quality"] += int(np.count_nonzero(bad & np.isfinite(column.values)))
    return dataclasses.replace(column, values=np.where(bad, np.nan, column.values), words=words)


def _whole_quality(
    plan: Plan, words: Mapping[int, Words]
) -> tuple[QualityArray | None, FlagArray | None, list[str]]:
    """Return the mask of a record's own file, or which rows are of bad quality, and notes."""
    sheet, read = plan.sheet, {index: words[index] for index in plan.whole_quality}
    if [sheet.layout.given[index] for index in read] == [QUALITY]:
        (own,) = read.values()
        known = [word.strip() for word in own.known]
        if QUALITY_WORDS.keys() >= set(known):
            table = np.array([QUALITY_WORDS[word] for word in known], dtype=np.uint8)
            return table[own.codes()], None, []
    return None, *_bad_rows(sheet, read)


def _bad_rows(
    sheet: Sheet, read: Mapping[int, Words], bad: FlagArray | None = None
) -> tuple[FlagArray | None, list[str]]:
    """Return which rows are bad or one of the columns says so, and notes on what is not known."""
    notes: list[str] = []
    for index, words in read.items():
        judged, note = bad_qualities(words, sheet.layout.given[index])
        bad = words.where(judged) | (False if bad is None else bad)
        notes += [note] if note else []
    return bad, notes
