"""Signals of one loop that stand beside each other in one table."""

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.intake.sheets.names import Tag
from stiction_ros.intake.sheets.stamps import Clock
from stiction_ros.records.record import QualityArray

FlagArray = NDArray[np.bool_]


class Key(NamedTuple):
    """One signal of a loop, ``op``, ``pv``, ``sp``, ``stem`` or ``mode``, of a valve or output."""

    signal: str
    tag: str

    @classmethod
    def of(cls, tag: Tag) -> "Key":
        """Return the key of what a name says; a mode is of the whole loop."""
        return cls(tag.signal, "" if tag.signal == "mode" else tag.loop)


@dataclasses.dataclass
class Column:
    """One signal as it was read."""

    name: str  # of its column or tag
    values: FloatArray  # shape (N,), NaN where there is no number; codes of words for a mode
    blank: FlagArray  # where nothing stood, shape (N,)
    words: Counter[str] = dataclasses.field(default_factory=Counter)  # in the place of numbers
    unit: str = ""  # as the export says, empty when it does not
    known: tuple[str, ...] = ()  # words of a mode, by their codes

    def rows(self, chosen: NDArray[np.intp] | FlagArray) -> "Column":
        return dataclasses.replace(self, values=self.values[chosen], blank=self.blank[chosen])


@dataclasses.dataclass
class Block:
    """Signals of a loop on one clock."""

    path: Path  # of the file
    row_word: str  # what a row is called in errors
    clock: Clock  # of the times
    time: FloatArray  # s since ``clock.start``, shape (N,), NaN where there is none
    lines: NDArray[np.int64]  # of the rows in the file, shape (N,)
    columns: dict[Key, Column]  # the signals
    mask: QualityArray | None = None  # quality of each row, None when the file does not say it
    notes: tuple[str, ...] = ()  # how it was read
    stray: str = ""  # the first time that is none, as an error says it; empty for none
    mended: tuple[str, ...] = ()  # what was wrong with the table and is put right, in sentences

    def of(self, *signals: str) -> dict[Key, Column]:
        """Return the columns of some signals, in their order."""
        return {key: column for key, column in self.columns.items() if key.signal in signals}

    @property
    def measured(self) -> dict[Key, Column]:
        """The columns of all signals but the mode."""
        return self.of("op", "pv", "sp", "stem")

    def with_columns(self, columns: Mapping[Key, Column]) -> "Block":
        """Return the block with other columns in the place of those of the same signals."""
        return dataclasses.replace(self, columns={**self.columns, **columns})

    def rows(self, chosen: NDArray[np.intp] | FlagArray) -> "Block":
        return dataclasses.replace(
            self,
            time=self.time[chosen],
            lines=self.lines[chosen],
            columns={key: column.rows(chosen) for key, column in self.columns.items()},
            mask=None if self.mask is None else self.mask[chosen],
        )

    def own_mask(self) -> QualityArray:
        """Return the quality of each row, good where the file does not say it, to be changed."""
        return np.zeros(len(self.time), dtype=np.uint8) if self.mask is None else self.mask.copy()

    def place(self, row: int) -> str:
        """Name a row for errors."""
        return f"{self.row_word} {self.lines[row]}"


def joined(blocks: Sequence[Block]) -> tuple[Block, dict[str, int]]:
    """Return blocks of one loop on one clock: every stamp that one of them has is a row.

    Where two blocks give one signal at one stamp the later block counts; how often they differ
    there is returned by the names of their columns.
    """
    if len(blocks) == 1:
        return blocks[0], {}
    differing: Counter[str] = Counter()
    start = min(block.clock.start for block in blocks)
    moved = [np.round(block.time + (block.clock.start - start), 6) for block in blocks]
    axis = np.unique(np.concatenate(moved))
    columns: dict[Key, Column] = {}
    for block, time in zip(blocks, moved, strict=True):
        for key, column in block.columns.items():
            into = columns.get(key)
            if into is None:
                values, blank = np.full(len(axis), np.nan), np.ones(len(axis), dtype=np.bool_)
                into = Column(column.name, values, blank, unit=column.unit)
            known = tuple(dict.fromkeys((*into.known, *column.known)))
            full = ~column.blank
            rows, given = np.searchsorted(axis, time[full]), column.values[full]
            if known:
                codes = np.array([known.index(word) for word in column.known], dtype=np.float64)
                given = codes[given.astype(np.intp)]
            old = into.values[rows]
            same = into.blank[rows] | (old == given) | (np.isnan(old) & np.isnan(given))
            differing[column.name] += int(np.count_nonzero(~same))
            into.values[rows], into.blank[rows] = given, False
            columns[key] = dataclasses.replace(into, known=known, words=into.words + column.words)
    clock, lines = blocks[0].clock._replace(start=start), np.arange(len(axis))
    return Block(blocks[0].path, "sample", clock, axis, lines, columns), dict(+differing)
