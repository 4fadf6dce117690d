"""What stands in the columns of a loop, for people who check whether they are the right ones."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.intake.repairs import outside
from stiction_ros.intake.tables.block import Block, Key
from stiction_ros.records.record import Record


class Spread(NamedTuple):
    """Least, median and largest value of a signal, in the unit of its column."""

    least: float
    median: float
    largest: float

    def __str__(self) -> str:
        return f"{self.least:.4g} to {self.largest:.4g}, median {self.median:.4g}"


def named(key: Key) -> str:
    """Return a signal as it is called for people: ``OP FIC101``."""
    return f"{key.signal.upper()} {key.tag}".strip()


def columns_of(blocks: Sequence[Block]) -> dict[str, str]:
    """Return signal to the column that it stands in."""
    return {named(key): column.name for one in blocks for key, column in one.columns.items()}


def spreads_of(blocks: Sequence[Block]) -> dict[str, Spread]:
    """Return what numbers each signal of a loop has, without those far outside all others."""
    measured = (item for block in blocks for item in block.measured.items())
    return _spreads((named(key), column.values) for key, column in measured)


def spreads_of_records(parts: Sequence[Record]) -> dict[str, Spread]:
    """Return the same of records, whose OP is in %."""
    found: list[tuple[str, FloatArray]] = []
    for part in parts:
        found += zip((f"OP {tag}" for tag in part.valves), part.op.T, strict=True)
        found += zip((f"PV {tag}" for tag in part.outputs), part.pv.T, strict=True)
        if part.sp is not None:
            found += zip((f"SP {tag}" for tag in part.outputs), part.sp.T, strict=True)
    return _spreads(found)


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


def _spreads(signals: Iterable[tuple[str, FloatArray]]) -> dict[str, Spread]:
    pieces: dict[str, list[FloatArray]] = {}
    for name, values in signals:
        pieces.setdefault(name, []).append(values)
    found = {}
    for name, values in ((name, np.concatenate(some)) for name, some in pieces.items()):
        usual = values[np.isfinite(values) & ~outside(values)]
        if len(usual):
            found[name] = Spread(float(usual.min()), float(np.median(usual)), float(usual.max()))
    return found
