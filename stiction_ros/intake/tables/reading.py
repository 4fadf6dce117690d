"""Reads tables into blocks of signals, one loop each."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import IntakeOptions
from stiction_ros.intake.sheets.cells import BAD_WORDS, Cells, Numbers, Words, number
from stiction_ros.intake.sheets.names import read_tag
from stiction_ros.intake.sheets.sheet import Sheet
from stiction_ros.intake.sheets.stamps import Stamps
from stiction_ros.intake.tables.block import Block, Clock, Column, FlagArray, Key
from stiction_ros.intake.tables.clock import in_seconds
from stiction_ros.intake.tables.plan import Plan, Shape
from stiction_ros.intake.tables.tags import TagList
from stiction_ros.intake.words import WORDS
from stiction_ros.records.csv_names import QUALITY
from stiction_ros.records.quality import QUALITY_WORDS, QualityArray

OPC_GOOD = 192
"""Codes of OPC from which a value is good."""

_MIDNIGHT = re.compile(r"[T ]0?0:00(:00(\.0+)?)?$")
_BAD = tuple(WORDS["bad_beginnings"])


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
    for quality in (*plan.quality.values(), plan.whole_quality):
        if quality is not None:
            words[quality] = Words()
    stamps = Stamps(sheet.decimal_comma, options.dates)
    lines: list[NDArray[np.int64]] = []
    for piece in sheet.pieces():
        stamps.add(_stamp_cells(piece.columns, plan))
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
    time, clock, stray, note = _times(sheet, plan, stamps, options, np.concatenate(lines))
    mask, whole_bad = _whole_quality(sheet, plan, words)
    found: dict[str, list[Block]] = {}
    for name, signals in plan.loops.items():
        columns: dict[Key, Column] = {}
        for key, index in signals.items():
            if key.signal == "mode":
                columns[key] = _mode(sheet, index, words[index])
                continue
            bad = whole_bad
            if index in plan.quality:
                beside = words[plan.quality[index]]
                bad = beside.where(bad_qualities(beside))
            columns[key] = _numbers(sheet, index, numbers[index], bad)
        found[name] = [
            Block(
                path=sheet.path,
                row_word=sheet.row_word,
                clock=clock,
                time=time,
                lines=np.concatenate(lines),
                columns=columns,
                mask=mask,
                notes=tuple(n for n in (*plan.notes, note) if n),
                stray=stray,
            )
        ]
    return found


def _stamp_cells(columns: Sequence[Cells], plan: Plan) -> Cells:
    date = columns[plan.time.place]
    if plan.time.beside is None:
        return date
    clock = columns[plan.time.beside]
    return [f"{_MIDNIGHT.sub('', str(d))} {c}".strip() for d, c in zip(date, clock, strict=True)]


def _times(
    sheet: Sheet, plan: Plan, stamps: Stamps, options: IntakeOptions, lines: NDArray[np.int64]
) -> tuple[NDArray[np.float64], Clock, str, str]:
    times = stamps.times(str(sheet.path))
    index = plan.time.place
    seconds, clock, note = in_seconds(times, sheet, index, options)
    stray = ""
    if times.wrong is not None:
        line = f"{sheet.row_word} {lines[times.wrong.row]}"
        stray = f"column {sheet.layout.given[index]} {times.wrong.said} in {line}"
    return seconds, clock, stray, " and ".join(n for n in (times.note, note) if n)


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
        unit=sheet.layout.units[index],
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
) -> tuple[QualityArray | None, FlagArray | None]:
    """Return the mask of a record's own file, or which rows are of bad quality."""
    if plan.whole_quality is None:
        return None, None
    read = words[plan.whole_quality]
    own = {word: word.strip() for word in read.known}
    if sheet.layout.given[plan.whole_quality] == QUALITY and QUALITY_WORDS.keys() >= set(
        own.values()
    ):
        table = np.array([QUALITY_WORDS[own[word]] for word in read.known], dtype=np.uint8)
        return table[read.codes()], None
    return None, read.where(bad_qualities(read))


def bad_qualities(read: Words) -> set[str]:
    """Return which words of a column of qualities tell of bad values.

    Numbers are OPC's: good from 192 on. Where no word tells of good or bad, none is bad.
    """
    told = {word: number(word.strip()) for word in read.known if word.strip()}
    codes = [code for code in told.values() if code is not None]
    if told and len(codes) == len(told):
        if max(codes) < OPC_GOOD:
            return set()
        return {word for word, code in told.items() if code is not None and code < OPC_GOOD}
    return {
        word
        for word in told
        if (folded := word.strip().casefold()).startswith(_BAD)
        or BAD_WORDS.fullmatch(folded)
        or folded in ("b", "false", "u")
    }


def _long(
    sheet: Sheet, plan: Plan, options: IntakeOptions, tags: TagList | None
) -> dict[str, list[Block]]:
    """Read a table with one value a row: one block a tag."""
    names, values = Words(), Numbers(sheet.decimal_comma)
    text = Words()
    quality = Words() if plan.whole_quality is not None else None
    units: dict[str, str] = {}
    stamps = Stamps(sheet.decimal_comma, options.dates)
    lines: list[NDArray[np.int64]] = []
    for piece in sheet.pieces():
        stamps.add(_stamp_cells(piece.columns, plan))
        names.add(piece.columns[plan.tag])
        values.add(piece.columns[plan.value])
        text.add(_only_words(piece.columns[plan.value]))
        if quality is not None and plan.whole_quality is not None:
            quality.add(piece.columns[plan.whole_quality])
        if plan.unit is not None:
            units.update(zip(piece.columns[plan.tag], piece.columns[plan.unit], strict=True))
        lines.append(piece.lines)
    if not lines:
        raise InputError("has 0 rows of data", where=str(sheet.path))
    place = np.concatenate(lines)
    time, clock, stray, note = _times(sheet, plan, stamps, options, place)
    numbers, blank = values.values(), values.blank()
    bad = None if quality is None else quality.where(bad_qualities(quality))
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
        column.unit = units.get(name, "").strip()
        found.setdefault(tag.loop, []).append(
            Block(
                path=sheet.path,
                row_word=sheet.row_word,
                clock=clock,
                time=time[rows],
                lines=place[rows],
                columns={key: column},
                notes=(note,) if note else (),
                stray=stray,
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
