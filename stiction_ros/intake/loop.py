"""One loop of a plant, as it was found in exports, and what stands in its columns."""

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.intake.repairs import outside
from stiction_ros.intake.tables.block import Block, Key
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
    columns: Mapping[str, str] = dataclasses.field(default_factory=dict)  # of each signal, or tag
    op_unit: str = "%"  # what OP is in; OP of a share or a current has been brought to %
    # signal to the least, largest and median number of its column, in words and in the column's own
    # unit; of bags OP in %
    spreads: Mapping[str, str] = dataclasses.field(default_factory=dict)
    modes: tuple[str, ...] = ()  # words of the mode, each with its count and what it is taken for

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


def named(key: Key) -> str:
    """Return a signal as it is called for people: ``OP FIC101``."""
    return f"{key.signal.upper()} {key.tag}".strip()


def columns_of(blocks: Sequence[Block]) -> dict[str, str]:
    """Return signal to the column that it stands in."""
    return {named(key): column.name for one in blocks for key, column in one.columns.items()}


def spreads_of(blocks: Sequence[Block]) -> dict[str, str]:
    """Return what numbers each signal of a loop has, without those far outside all others."""
    measured = (item for block in blocks for item in block.measured.items())
    return _spreads((named(key), column.values) for key, column in measured)


def spreads_of_records(parts: Sequence[Record]) -> dict[str, str]:
    """Return the same of records, whose OP is in %."""
    signals = [(part, key, values) for part in parts for key, values in part.signals.items()]
    return _spreads(
        (f"{key.upper()} {tag}", column)
        for part, key, values in signals
        for tag, column in zip(part.tags(key), values.T, strict=True)
    )


def modes_of(blocks: Sequence[Block], taken: Mapping[str, str]) -> tuple[str, ...]:
    """Return words of the mode, most frequent first, with count and what each is ``taken`` for."""
    counts: Counter[str] = Counter()
    for block in blocks:
        for column in block.of("mode").values():
            codes = column.values[np.isfinite(column.values)].astype(np.intp)
            counts.update(column.known[code] for code in codes.tolist())
    return tuple(
        f"{count} {word or 'empty'}{f' ({taken[word]})' if word in taken else ''}"
        for word, count in counts.most_common()
    )


def _spreads(signals: Iterable[tuple[str, FloatArray]]) -> dict[str, str]:
    pieces: dict[str, list[FloatArray]] = {}
    for name, values in signals:
        pieces.setdefault(name, []).append(values)
    found = {}
    for name, values in ((name, np.concatenate(some)) for name, some in pieces.items()):
        usual = values[np.isfinite(values) & ~outside(values)]
        if len(usual):
            middle = np.median(usual)
            found[name] = f"{usual.min():.4g} to {usual.max():.4g}, median {middle:.4g}"
    return found
