"""One loop of a plant, as it was found in exports, and what stands in its columns."""

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.intake.repairs import outside
from stiction_ros.intake.tables.block import Block, Column, Key
from stiction_ros.records.parts import span
from stiction_ros.records.record import Record


@dataclasses.dataclass(frozen=True)
class Loop:
    """A named loop with its records, or the reason why there are none."""

    name: str  # of the loop: its tag, or the name of its file
    files: tuple[Path, ...]  # that it was read from
    # its records, one for each stretch without a gap, in their order; a sample's quality says what
    # was held, bad or in manual. Empty when there is a problem
    parts: tuple[Record, ...]
    notes: tuple[str, ...] = ()  # what was masked, held, cut, converted; the records bear the same
    problem: str | None = None  # why it cannot be read and what helps; None when it can be
    op_unit: str = "%"  # what OP is in; OP of a share or a current has been brought to %
    # each signal with its column, and the least, largest and median number there in the column's
    # own unit, or the words of the mode; of bags OP in %
    signals: tuple[str, ...] = ()

    @property
    def summary(self) -> str:
        """Samples, sample time, span and unit of OP in one sentence; or the problem."""
        if self.problem is not None:
            return self.problem
        samples = sum(map(len, self.parts))
        steps = sorted({f"{part.sample_time:.6g} s" for part in self.parts})
        parts = f" in {len(self.parts)} parts" if len(self.parts) > 1 else ""
        return (
            f"{samples} samples{parts}, one each {' or '.join(steps)}, {span(*self.parts)}, "
            f"OP in {self.op_unit}"
        )


def signals_of_blocks(blocks: Sequence[Block], modes: Mapping[str, str]) -> tuple[str, ...]:
    """Return each signal of a loop with its column, and the numbers or words that stand there.

    What the words of a mode are taken for is said by ``modes``, where it is known.
    """
    every: dict[Key, list[Column]] = {}
    for key, column in ((k, c) for block in blocks for k, c in block.columns.items()):
        every.setdefault(key, []).append(column)
    return tuple(
        f"{key.signal.upper()} {key.tag}".strip() + f" from {columns[-1].name}"
        f"{_words(columns, modes) if key.signal == 'mode' else _spread(c.values for c in columns)}"
        for key, columns in every.items()
    )


def signals_of_records(parts: Sequence[Record]) -> tuple[str, ...]:
    """Return the same of records, whose OP is in %."""
    every: dict[str, list[FloatArray]] = {}
    for part, key, values in ((p, k, v) for p in parts for k, v in p.signals.items()):
        for tag, column in zip(part.tags(key), values.T, strict=True):
            every.setdefault(f"{key.upper()} {tag}", []).append(column)
    return tuple(f"{name}{_spread(pieces)}" for name, pieces in every.items())


def _words(columns: Sequence[Column], taken: Mapping[str, str]) -> str:
    """Return words of a mode, most frequent first, with count and what each is ``taken`` for."""
    counts: Counter[str] = Counter()
    for column in columns:
        codes = column.values[np.isfinite(column.values)].astype(np.intp)
        counts.update(column.known[code] for code in codes.tolist())
    told = (
        f"{count} {word or 'empty'}{f' ({taken[word]})' if word in taken else ''}"
        for word, count in counts.most_common()
    )
    return f": {', '.join(told)}" if counts else ""


def _spread(pieces: Iterable[FloatArray]) -> str:
    """Return least, largest and median of numbers, without those far outside all others."""
    values = np.concatenate(list(pieces))
    usual = values[np.isfinite(values) & ~outside(values)]
    if not len(usual):
        return ""
    return f": {usual.min():.4g} to {usual.max():.4g}, median {np.median(usual):.4g}"
