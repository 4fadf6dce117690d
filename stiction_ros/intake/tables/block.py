"""Signals of one loop that stand beside each other in one table."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.quality import QualityArray

FlagArray = NDArray[np.bool_]


class Key(NamedTuple):
    """One signal of a loop.

    Attributes:
        signal: ``op``, ``pv``, ``sp``, ``stem`` or ``mode``.
        tag: of its valve or output.
    """

    signal: str
    tag: str


class Clock(NamedTuple):
    """What times are counted from.

    Attributes:
        start: the first time, seconds since 1970 in UTC when it is dated.
        dated: whether it is a date.
        zoned: whether its zone is known.
        zone: whose local time it is, where that is not yet brought to UTC; else empty.
        daily: whether it counts from midnight each day.
    """

    start: float
    dated: bool
    zoned: bool
    zone: str = ""
    daily: bool = False


@dataclasses.dataclass
class Column:
    """One signal as it was read.

    Attributes:
        name: of its column or tag.
        values: shape (N,), NaN where there is no number; codes of words for a mode.
        blank: where nothing stood, shape (N,).
        said: what the first cell that is no number is, empty for none.
        row: of that cell.
        words: what stood in the place of numbers, with its count.
        unit: as the export says, empty when it does not.
        known: words of a mode, by their codes.
    """

    name: str
    values: FloatArray
    blank: FlagArray
    said: str = ""
    row: int = 0
    words: Counter[str] = dataclasses.field(default_factory=Counter)
    unit: str = ""
    known: tuple[str, ...] = ()

    def rows(self, chosen: NDArray[np.intp] | FlagArray) -> Column:
        """Return some of its rows."""
        return dataclasses.replace(self, values=self.values[chosen], blank=self.blank[chosen])


@dataclasses.dataclass
class Block:
    """Signals of a loop on one clock.

    Attributes:
        path: of the file.
        row_word: what a row is called in errors.
        clock: of the times.
        time: s since ``clock.start``, shape (N,), NaN where there is none.
        lines: of the rows in the file, shape (N,).
        columns: the signals.
        mask: quality of each row as the file says it, None when it does not.
        notes: how it was read.
        stray: the first time that is none, as an error says it; empty for none.
        mended: what was wrong with the table and is put right, in sentences.
    """

    path: Path
    row_word: str
    clock: Clock
    time: FloatArray
    lines: NDArray[np.int64]
    columns: Mapping[Key, Column]
    mask: QualityArray | None = None
    notes: tuple[str, ...] = ()
    stray: str = ""
    mended: tuple[str, ...] = ()

    def tags(self, signal: str) -> tuple[str, ...]:
        """Return the tags of a signal, in their order."""
        return tuple(key.tag for key in self.columns if key.signal == signal)

    def rows(self, chosen: NDArray[np.intp] | FlagArray) -> Block:
        """Return some of its rows."""
        return dataclasses.replace(
            self,
            time=self.time[chosen],
            lines=self.lines[chosen],
            columns={key: column.rows(chosen) for key, column in self.columns.items()},
            mask=None if self.mask is None else self.mask[chosen],
        )

    def place(self, row: int) -> str:
        """Name a row for errors."""
        return f"{self.row_word} {self.lines[row]}"


def joined(blocks: list[Block]) -> tuple[Block, dict[str, int]]:
    """Return blocks of one loop on one clock: every stamp that one of them has is a row.

    Where two blocks give one signal at one stamp the later block counts; how often they differ
    there is returned by the names of their columns.
    """
    if len(blocks) == 1:
        return blocks[0], {}
    differing: Counter[str] = Counter()
    start = min(block.clock.start for block in blocks)
    moved = [block.time + (block.clock.start - start) for block in blocks]
    everything = np.concatenate(moved)
    axis = np.unique(np.round(everything[np.isfinite(everything)], 6))
    columns: dict[Key, Column] = {}
    for block, time in zip(blocks, moved, strict=True):
        there = np.isfinite(time)
        at = np.searchsorted(axis, np.round(time[there], 6))
        for key, column in block.columns.items():
            into = columns.get(key)
            if into is None:
                into = dataclasses.replace(
                    column,
                    values=np.full(len(axis), np.nan),
                    blank=np.ones(len(axis), dtype=np.bool_),
                    words=Counter(),
                    known=(),
                )
            given, known = column.values[there], into.known
            if column.known:
                known = tuple(dict.fromkeys((*known, *column.known)))
                codes = np.array([known.index(word) for word in column.known], dtype=np.float64)
                given = codes[given.astype(np.intp)]
            full = ~column.blank[there]
            rows, given = at[full], given[full]
            told, same = ~into.blank[rows], into.values[rows] == given
            same |= np.isnan(into.values[rows]) & np.isnan(given)
            differing[column.name] += int(np.count_nonzero(told & ~same))
            into.values[rows], into.blank[rows] = given, False
            columns[key] = dataclasses.replace(
                into, known=known, words=into.words + column.words, said=into.said or column.said
            )
    whole = Block(
        path=blocks[0].path,
        row_word="sample",
        clock=blocks[0].clock._replace(start=start),
        time=axis,
        lines=np.arange(len(axis)),
        columns=columns,
        notes=tuple(dict.fromkeys(note for block in blocks for note in block.notes)),
        stray=next((block.stray for block in blocks if block.stray), ""),
    )
    return whole, dict(+differing)
