"""Reads tables into blocks of signals, one loop each."""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import IntakeOptions
from stiction_ros.intake.sheets.cells import Cells, Numbers, Words
from stiction_ros.intake.sheets.names import read_tag, unit_in
from stiction_ros.intake.sheets.sheet import Sheet
from stiction_ros.intake.sheets.stamps import Stamps
from stiction_ros.intake.tables.block import Block, Clock, Column, FlagArray, Key
from stiction_ros.intake.tables.clock import ROWS_APART, TimeColumn, in_seconds
from stiction_ros.intake.tables.plan import Plan, Shape
from stiction_ros.intake.tables.qualities import bad_qualities
from stiction_ros.intake.tables.tags import TagList
from stiction_ros.records.csv_names import QUALITY
from stiction_ros.records.quality import QUALITY_WORDS, QualityArray

_MIDNIGHT = re.compile(r"[T ]0?0:00(:00(\.0+)?)?$")


def blocks_of(
    sheet: Sheet, plan: Plan, options: IntakeOptions, tags: TagList | None
) -> dict[str, list[Block]]:
    """Read a table into blocks, by the name of their loop.

    Raises:
        InputError: times that cannot be read, or the file is damaged.
    """
    if plan.shape is Shape.LONG:
        return _long(sheet, plan, options, tags)
    return _beside(sheet, plan, options)


def _beside(sheet: Sheet, plan: Plan, options: IntakeOptions) -> dict[str, list[Block]]:
    """Read a table with one row a stamp."""
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
    stamps = {
        clock: Stamps(sheet.decimal_comma, options.dates)
        for clock in (plan.time, *plan.own.values())
    }
    lines: list[NDArray[np.int64]] = []
    for piece in sheet.pieces():
        for clock, cells in stamps.items():
            if clock != ROWS_APART:
                cells.add(_stamp_cells(piece.columns, clock))
        for accumulated in (numbers, words):
            for index, column in accumulated.items():
                column.add(piece.columns[index])
        lines.append(piece.lines)
    count = sum(map(len, lines))
    if count < 2:
        raise InputError(
            f"has {count} row{'s' * (count != 1)} of data",
            where=str(sheet.path),
            fix="a record needs two at least",
        )
    place = np.concatenate(lines)
    timed = {clock: _times(sheet, clock, read, options, place) for clock, read in stamps.items()}
    mask, whole_bad, told = _whole_quality(sheet, plan, words)
    notes = [*plan.notes, *(time.note for time in timed.values()), *told]
    found: dict[str, list[Block]] = {}
    for name, signals in plan.loops.items():
        columns: dict[int, dict[Key, Column]] = {}
        clocks: list[_Timed] = []
        own: list[str] = []
        for key, index in signals.items():
            time = timed[plan.own.get(index, plan.time)]
            same = next((k for k, other in enumerate(clocks) if other.same(time)), len(clocks))
            clocks += [time] if same == len(clocks) else []
            if key.signal == "mode":
                its = _mode(sheet, index, words[index])
            else:
                bad = whole_bad
                for beside in plan.quality.get(index, ()):
                    judged, note = bad_qualities(words[beside], sheet.layout.given[beside])
                    own.append(note)
                    bad = words[beside].where(judged) | (False if bad is None else bad)
                its = _numbers(sheet, index, numbers[index], bad)
            columns.setdefault(same, {})[key] = its
        found[name] = [
            _filled_rows(
                Block(
                    path=sheet.path,
                    row_word=sheet.row_word,
                    clock=clocks[k].clock,
                    time=clocks[k].seconds,
                    lines=place,
                    columns=there,
                    mask=mask,
                    notes=tuple(dict.fromkeys(n for n in (*notes, *own) if n)),
                    stray=clocks[k].stray,
                    mended=tuple(sheet.mended),
                ),
                alone=not plan.own,
            )
            for k, there in columns.items()
        ]
    return found


class _Timed(NamedTuple):
    """Times of a table, as :class:`Block` has them."""

    seconds: NDArray[np.float64]
    clock: Clock
    stray: str
    note: str

    def same(self, other: _Timed) -> bool:
        """Tell whether other times are these."""
        equal = np.array_equal(self.seconds, other.seconds, equal_nan=True)
        return self is other or (self.clock == other.clock and equal)


def _filled_rows(block: Block, *, alone: bool) -> Block:
    """Return the rows of signals with times of their own that hold a time or a value."""
    blank = np.all([column.blank for column in block.columns.values()], axis=0)
    there = np.isfinite(block.time) | ~blank
    if alone or there.all():
        return block
    stray = "" if np.isfinite(block.time[there]).all() else block.stray
    return dataclasses.replace(block.rows(there), stray=stray)


def _stamp_cells(columns: Sequence[Cells], time: TimeColumn) -> Cells:
    date = columns[time.place]
    if time.beside is None:
        return date
    clock = columns[time.beside]
    return [f"{_MIDNIGHT.sub('', str(d))} {c}".strip() for d, c in zip(date, clock, strict=True)]


def _times(
    sheet: Sheet,
    place: TimeColumn,
    stamps: Stamps,
    options: IntakeOptions,
    lines: NDArray[np.int64],
) -> _Timed:
    index = place.place
    if place == ROWS_APART:
        apart = (options.sample_time or 1.0) * np.arange(len(lines), dtype=np.float64)
        return _Timed(apart, Clock(0.0, dated=False, zoned=False), "", "")
    times = stamps.times(str(sheet.path))
    seconds, clock, note = in_seconds(times, sheet, index, options)
    stray = ""
    if times.wrong is not None:
        line = f"{sheet.row_word} {lines[times.wrong.row]}"
        stray = f"column {sheet.layout.given[index]} {times.wrong.said} in {line}"
    return _Timed(seconds, clock, stray, " and ".join(n for n in (times.note, note) if n))


def _numbers(sheet: Sheet, index: int, read: Numbers, bad: FlagArray | None) -> Column:
    values, words = read.values(), read.words
    if bad is not None and bad.any():
        words = words.copy()
        words["of bad quality"] += int(np.count_nonzero(bad & np.isfinite(values)))
        values = np.where(bad, np.nan, values)
    wrong = read.wrong
    return Column(
        name=sheet.layout.given[index],
        values=values,
        blank=read.blank(),
        said="" if wrong is None else wrong.said,
        row=0 if wrong is None else wrong.row,
        words=words,
        unit=sheet.layout.units[index] or unit_in(sheet.layout.given[index]),
    )


def _mode(sheet: Sheet, index: int, read: Words) -> Column:
    codes = read.codes()
    blank = read.where({word for word in read.known if not word.strip()})
    return Column(
        name=sheet.layout.given[index],
        values=codes.astype(np.float64),
        blank=blank,
        known=tuple(word.strip() for word in read.known),
    )


def _whole_quality(
    sheet: Sheet, plan: Plan, words: dict[int, Words]
) -> tuple[QualityArray | None, FlagArray | None, list[str]]:
    """Return the mask of a record's own file, or which rows are of bad quality, and notes."""
    if len(plan.whole_quality) == 1:
        read = words[plan.whole_quality[0]]
        own = {word: word.strip() for word in read.known}
        if sheet.layout.given[plan.whole_quality[0]] == QUALITY and QUALITY_WORDS.keys() >= set(
            own.values()
        ):
            table = np.array([QUALITY_WORDS[own[word]] for word in read.known], dtype=np.uint8)
            return table[read.codes()], None, []
    return None, *_bad_rows(sheet, {index: words[index] for index in plan.whole_quality})


def _bad_rows(sheet: Sheet, read: dict[int, Words]) -> tuple[FlagArray | None, list[str]]:
    """Return which rows one of the columns of qualities calls bad, and what is not known."""
    bad: FlagArray | None = None
    notes: list[str] = []
    for index, words in read.items():
        judged, note = bad_qualities(words, sheet.layout.given[index])
        bad = words.where(judged) | (False if bad is None else bad)
        notes += [note] if note else []
    return bad, notes


def _long(
    sheet: Sheet, plan: Plan, options: IntakeOptions, tags: TagList | None
) -> dict[str, list[Block]]:
    """Read a table with one value a row: one block a tag."""
    names, values = Words(), Numbers(sheet.decimal_comma)
    text = Words()
    quality = {index: Words() for index in plan.whole_quality}
    units: dict[str, str] = {}
    stamps = Stamps(sheet.decimal_comma, options.dates)
    lines: list[NDArray[np.int64]] = []
    for piece in sheet.pieces():
        stamps.add(_stamp_cells(piece.columns, plan.time))
        names.add(piece.columns[plan.tag])
        values.add(piece.columns[plan.value])
        text.add(_only_words(piece.columns[plan.value]))
        for index, told in quality.items():
            told.add(piece.columns[index])
        if plan.unit is not None:
            units.update(zip(piece.columns[plan.tag], piece.columns[plan.unit], strict=True))
        lines.append(piece.lines)
    if not lines:
        raise InputError("has 0 rows of data", where=str(sheet.path))
    place = np.concatenate(lines)
    time, clock, stray, note = _times(sheet, plan.time, stamps, options, place)
    numbers, blank = values.values(), values.blank()
    bad, notes = _bad_rows(sheet, quality)
    order = np.argsort(names.codes(), kind="stable")
    edges = np.searchsorted(names.codes()[order], np.arange(len(names.known) + 1))
    found: dict[str, list[Block]] = {}
    shown, codes = tuple(text.known), text.codes()
    for code, name in enumerate(names.known):
        tag = tags.read(name) if tags is not None else read_tag(name)
        if tag is None or not tag.loop or tag.quality:
            continue
        rows = order[edges[code] : edges[code + 1]]
        key = Key(tag.signal, "" if tag.signal == "mode" else tag.loop)
        if tag.signal == "mode":
            column = _mode_of(name, numbers[rows], codes[rows], shown)
        else:
            read = Numbers(sheet.decimal_comma)
            read.words.update(shown[c] for c in codes[rows].tolist() if shown[c])
            column = Column(name, numbers[rows], blank[rows], words=read.words)
            if column.words or blank[rows].any():
                row = int(np.argmax(~np.isfinite(column.values)))
                column.row, column.said = row, f"is {shown[codes[rows[row]]]!r}, not a number"
            if bad is not None and bad[rows].any():
                column.words["of bad quality"] += int(
                    np.count_nonzero(bad[rows] & np.isfinite(column.values))
                )
                column.values = np.where(bad[rows], np.nan, column.values)
        column.unit = units.get(name, "").strip() or unit_in(name)
        found.setdefault(tag.loop, []).append(
            Block(
                path=sheet.path,
                row_word=sheet.row_word,
                clock=clock,
                time=time[rows],
                lines=place[rows],
                columns={key: column},
                notes=tuple(n for n in (note, *notes) if n),
                stray="" if np.isfinite(time[rows]).all() else stray,
                mended=tuple(sheet.mended),
            )
        )
    return found


def _only_words(cells: Cells) -> Cells:
    """Return cells with numbers left empty, so that only few different ones are left."""
    if isinstance(cells, np.ndarray):
        return [""] * len(cells)
    return ["" if cell[-1:].isdigit() else cell.strip() for cell in cells]


def _mode_of(
    name: str, numbers: NDArray[np.float64], codes: NDArray[np.int32], shown: Sequence[str]
) -> Column:
    words = [
        shown[code] if shown[code] else ("" if value != value else f"{value:g}")
        for code, value in zip(codes.tolist(), numbers.tolist(), strict=True)
    ]
    known = tuple(dict.fromkeys(words))
    place = {word: k for k, word in enumerate(known)}
    values = np.array([place[word] for word in words], dtype=np.float64)
    blank = np.array([not word for word in words], dtype=np.bool_)
    return Column(name, values, blank, known=known)
