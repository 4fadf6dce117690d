"""What is wrong with the rows of a loop: told, counted, and masked, held or cut by one rule.

Rows without a time are left out, single rows out of order sorted; of rows with one stamp the last
counts. What is no number, of bad quality, or far outside everything else (a sentinel such as −9999)
is missing: up to :data:`HELD` samples in a row are held (OP, SP) or interpolated (PV), more are
bad. Missing set-points are held however long.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.tables.block import Block, Column, FlagArray, Key
from stiction_ros.intake.words import WORDS
from stiction_ros.records.parts import stretches
from stiction_ros.records.quality import Quality, QualityArray
from stiction_ros.records.regular import evenly

IndexArray = NDArray[np.intp]

HELD = 5
"""Samples in a row that are held at most; a gap in time is one from 5.5 samples on."""

FAR = 5.0
"""How many times the range of all other values a value is away that cannot belong to them."""

SENTINEL_FAR = 0.5
"""The same for numbers that stand for bad values."""

SENTINELS: tuple[float, ...] = tuple(WORDS["sentinels"])
"""Numbers that loggers and controllers write in the place of a bad value."""

FEWEST_USUAL = 10
"""Values from which on it can be told that another one does not belong to them."""

FEWEST_STAMPS = 5
"""Stamps from which on it can be told that they are cut off."""

DIFFERENT = 0.5
"""Share of rows with a stamp that was there already in which OP or PV must differ, for the same."""

RARE = 0.2
"""Share of a signal that may lie far outside."""

FEW = 0.01
"""Share of stamps that may be left out as not understood."""

FORMS = (
    "write times as 2024-10-17 21:55:00, 17.10.2024 21:55, 10/17/2024 9:55 PM, 17 Oct 2024 21:55 "
    "or 20241017215500, with or without a zone such as Z, +02:00, CET or Europe/Berlin"
)
"""How to mend stamps that are not understood."""

FIX = "correct it, fill it or cut the record there"


@dataclasses.dataclass(frozen=True)
class Rules:
    """How strict to be.

    Attributes:
        strict: whether anything wrong is an error.
        told: sentences on what was done, in their order.
        modes: word of a mode to what it is taken for.
    """

    strict: bool
    told: list[str] = dataclasses.field(default_factory=list)
    modes: dict[str, str] = dataclasses.field(default_factory=dict)

    def tell(self, note: str, where: Block, said: str, fix: str = FIX) -> None:
        """Note what is repaired, or raise when nothing may be.

        Args:
            note: for the record.
            where: what is repaired.
            said: what is wrong, for the error.
            fix: how to mend it.

        Raises:
            InputError: strict.
        """
        if self.strict:
            raise InputError(said, where=str(where.path), fix=fix)
        self.told.append(note)


def plural(count: int, what: str) -> str:
    """Return ``1 row`` or ``3 rows``."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def with_times(block: Block, rules: Rules) -> Block:
    """Return the rows that have a time.

    Raises:
        InputError: none has one, or more than :data:`FEW` have one that is not understood.
    """
    there, strange = np.isfinite(block.time), int(np.count_nonzero(np.isinf(block.time)))
    lost = len(there) - int(np.count_nonzero(there))
    if not lost:
        return block
    where = str(block.path)
    said = f"{plural(strange, 'stamp')} of {len(there)} not understood, the first: {block.stray}"
    if strange > FEW * len(there) or lost == len(there):
        fix = f"{FORMS}; or choose the column with --time COLUMN"
        raise InputError(said if strange else block.stray, where=where, fix=fix)
    if strange:
        rules.tell(f"{said}, left out", block, block.stray)
    if lost > strange:
        note = f"{plural(lost - strange, 'row')} without a time left out"
        rules.tell(note, block, block.stray)
    return block.rows(there)


def with_values(block: Block, rules: Rules, *, shared: bool) -> Block:
    """Return the rows in which OP, PV, SP or the stem has a value, be it a bad one.

    Args:
        block: as read.
        rules: what is left out is noted there.
        shared: whether other loops stand in the same rows, which then say nothing of this one.
    """
    columns = [column for key, column in block.columns.items() if key.signal != "mode"]
    empty = np.all([column.blank for column in columns], axis=0)
    if block.mask is not None:
        empty &= block.mask != Quality.BAD
    if not empty.any() or empty.all():
        return block
    if not shared:
        row = int(np.argmax(empty))
        note = f"{plural(int(empty.sum()), 'row')} without any value left out"
        rules.tell(note, block, f"{block.place(row)} has no value")
    return block.rows(~empty)


def checked(block: Block, rules: Rules) -> Block:
    """Return the block with what is no number counted; strict, the first such cell is an error."""
    for key, column in block.columns.items():
        if key.signal == "mode":
            continue
        missing = ~np.isfinite(column.values)
        if block.mask is not None:
            missing &= block.mask != Quality.BAD
        if missing.all() and key.signal in ("op", "pv"):
            shown = " ".join(repr(word) for word, _ in column.words.most_common(2) if word)
            raise InputError(
                f"column {column.name} holds no number{f', but {shown}' if shown else ''}",
                where=str(block.path),
                fix="choose others with --op TAG=COLUMN --pv TAG=COLUMN, or tags with --tags F",
            )
        if not missing.any():
            continue
        row = int(np.argmax(missing))
        said = column.said if column.said and column.row == row else "is bad"
        rules.tell(
            f"{column.name}: {plural(int(missing.sum()), 'value')} of {len(missing)} "
            f"missing{_listed(column, missing)}",
            block,
            f"column {column.name} {said} in {block.place(row)}",
        )
    return block


def _listed(column: Column, missing: FlagArray) -> str:
    """Return what stands in the place of missing values, without counts where they are not known.

    Words are counted over all rows of the file, of which those without a time are left out.
    """
    words = Counter({word: count for word, count in column.words.items() if word and count})
    empty = int(np.count_nonzero(missing & column.blank))
    counted = words.total() + empty <= np.count_nonzero(missing)
    told = [f"{count} {word!r}" if counted else repr(word) for word, count in words.most_common(4)]
    told += [f"{empty} empty"] if empty else []
    return f" ({', '.join(told)})" if told else ""


def in_order(block: Block, rules: Rules) -> list[Block]:
    """Return the rows with increasing stamps; several blocks when the clock began anew."""
    time = block.time
    steps = np.diff(time)
    if (steps > 0).all():
        return [block]
    falls = np.flatnonzero(steps <= 0)
    row = int(falls[0]) + 1
    said = (
        f"time does not increase at {block.place(row)} ({block.clock.start + time[row - 1]:.9g}, "
        f"then {block.clock.start + time[row]:.9g} s)"
    )
    fix = "sort the rows and remove those that are there twice"
    if rules.strict:
        raise InputError(said, where=str(block.path), fix=fix)
    back = np.flatnonzero(steps < 0)
    if len(back) and len(back) <= 0.001 * len(time) + 3:
        runs = np.split(np.arange(len(time)), back + 1)
        longest = [run for run in runs if len(run) >= max(10, 0.02 * len(time))]
        begins = sorted((float(time[run[0]]), float(time[run[-1]])) for run in longest)
        overlap = any(b[0] <= a[1] for a, b in itertools.pairwise(begins))
        if len(longest) > 1 and overlap and not block.clock.dated:
            rules.told.append(f"time begins anew: {len(longest)} runs")
            return [one for run in longest for one in in_order(block.rows(run), rules)]
    order = np.argsort(time, kind="stable")
    if len(back):
        rules.told.append(f"{plural(len(back), 'row')} out of order sorted")
    return [_without_repeats(block.rows(order), rules)]


def sorted_rows(block: Block, rules: Rules) -> Block:
    """Return the rows of one of several tables by :func:`in_order`, as one block."""
    told = len(rules.told)
    runs = in_order(block, rules)
    if len(runs) == 1:
        return runs[0]
    del rules.told[told:]
    return _without_repeats(block.rows(np.argsort(block.time, kind="stable")), rules)


def _without_repeats(block: Block, rules: Rules) -> Block:
    """Return the last row of each stamp, with what earlier ones have where it has nothing."""
    last = np.append(np.diff(block.time) > 0, True)
    if last.all():
        return block
    differing = 0
    first = np.flatnonzero(np.insert(last[:-1], 0, True))
    group = np.cumsum(np.insert(last[:-1], 0, True)) - 1
    columns: dict[Key, Column] = {}
    moved = np.ptp(np.sign(np.diff(block.lines))) > 0
    spread = None if moved else _spread(block, first)
    if spread is not None:
        rules.told.append(
            f"stamps lack what is below {spread.step:g} s: {spread.usual} rows on each, spread "
            "evenly"
        )
        return dataclasses.replace(block, time=spread.time)
    for key, column in block.columns.items():
        here = np.flatnonzero(~column.blank)
        values = np.full(len(first), np.nan)
        blank = np.ones(len(first), dtype=np.bool_)
        values[group[here]] = column.values[here]
        blank[group[here]] = False
        there = here[np.isfinite(column.values[here])]
        differing += int(np.count_nonzero(column.values[there] != values[group[there]]))
        columns[key] = dataclasses.replace(column, values=values, blank=blank)
    kept = block.rows(last)
    of = f"{next(iter(columns.values())).name}: " if len(columns) == 1 else ""
    said = f"{of}{plural(len(last) - len(first), 'row')} with a stamp that was there already"
    note = f"{said}: the last value counts, {differing} differ" if differing else f"{said} left out"
    rules.tell(note, block, said, "remove those that are there twice")
    return dataclasses.replace(kept, columns=columns)


class _Spread(NamedTuple):
    step: float
    usual: str
    time: FloatArray


def _spread(block: Block, first: IndexArray) -> _Spread | None:
    """Return times of rows whose stamps were cut off, as minutes without their seconds.

    Then every stamp has as many rows but for one, stamps follow each other evenly, and what stands
    in the rows differs; where a stamp has one row, those with two come evenly. None for rows that
    are there twice.

    Args:
        block: rows in order.
        first: first row of each stamp.
    """
    counts = np.diff(np.append(first, len(block.time)))
    stamps = block.time[first]
    if len(first) < FEWEST_STAMPS:
        return None
    steps, inner = np.diff(stamps), counts[1:-1]
    usual = int(np.median(inner))
    even = np.ptp(steps) <= 1e-6 * steps[0] and np.ptp(inner) <= 1 and counts.max() <= usual + 1
    again = np.setdiff1d(np.arange(len(block.time)), first)
    differs = [
        column.values[again] != column.values[again - 1]
        for key, column in block.columns.items()
        if key.signal in ("op", "pv")
    ]
    if not even or not np.any(differs, axis=0).mean() > DIFFERENT:
        return None
    rows, step = np.arange(len(block.time)), float(steps[0])
    line = np.polyval(np.polyfit(rows, block.time - stamps[0], 1), rows) + stamps[0]
    late, scan = line - block.time, float(line[1] - line[0])
    twice = evenly(np.flatnonzero(inner > 1))
    fits = bool(np.ptp(inner)) and np.ptp(late) <= step + 0.5 * scan
    if fits and (usual > 1 or (len(twice) > 1 and twice.all())):
        return _Spread(step, f"{step / scan:.3g}", line - late.min())
    if usual < 2:
        return None
    within = np.arange(len(block.time)) - np.repeat(first, counts)
    of = np.maximum(np.repeat(counts, counts), usual)
    within[: counts[0]] += max(usual - int(counts[0]), 0)  # the first stamp has its last rows
    time = block.time + step * within / of
    return _Spread(step, str(usual), np.asarray(time))


def without_outliers(block: Block, rules: Rules) -> Block:
    """Return OP, PV and SP with NaN where a value is far outside everything else."""
    columns = dict(block.columns)
    for key, column in block.columns.items():
        if key.signal == "mode":
            continue
        far = outside(column.values)
        if not far.any():
            continue
        row = int(np.argmax(far))
        worst = f"{column.values[row]:g}"
        rules.tell(
            f"{column.name}: {plural(int(far.sum()), 'value')} such as {worst} far outside "
            "all others taken as missing",
            block,
            f"column {column.name} is {worst} in {block.place(row)}, far outside all others",
        )
        columns[key] = dataclasses.replace(column, values=np.where(far, np.nan, column.values))
    return dataclasses.replace(block, columns=columns)


def outside(values: FloatArray) -> FlagArray:
    """Return which values are sentinels or stray far from all others, shape (N,)."""
    there = np.isfinite(values)
    found = np.zeros(len(values), dtype=np.bool_)
    known = np.isin(values, SENTINELS)
    rest = values[there & ~known]
    if known.any() and len(rest) and len(values) > FEWEST_USUAL:
        low, high = float(rest.min()), float(rest.max())
        room = SENTINEL_FAR * max(high - low, 1e-3 * abs(high), 1e-12)
        found |= known & ((values < low - room) | (values > high + room))
    usual = values[there & ~found]
    if len(usual) >= FEWEST_USUAL:
        low, high = np.percentile(usual, [1.0, 99.0])
        room = FAR * max(float(high - low), 1e-3 * abs(float(high)), 1e-12)
        stray = there & ~found & ((values < low - room) | (values > high + room))
        if _isolated(stray, there):
            found |= stray
    return found if np.count_nonzero(found) <= RARE * len(values) else np.zeros_like(found)


def _isolated(stray: FlagArray, there: FlagArray) -> bool:
    """Return whether stray values come alone, so that no signal was that far out."""
    if not stray.any():
        return False
    begins, ends = stretches(stray[there])
    return bool((ends - begins).max() <= HELD and stray.sum() <= 0.02 * there.sum())


def filled(block: Block, rules: Rules) -> Block:
    """Return the block without missing values but in rows that are bad.

    Args:
        block: one row a sample.
        rules: what was done is noted there.
    """
    count = len(block.time)
    mask: QualityArray = (
        np.zeros(count, dtype=np.uint8) if block.mask is None else np.array(block.mask)
    )
    columns = dict(block.columns)
    held, bad = np.zeros(count, dtype=np.bool_), mask == Quality.BAD
    given = bad.copy()
    for key, column in block.columns.items():
        if key.signal == "mode":
            continue
        missing = ~np.isfinite(column.values) & ~given
        if not missing.any():
            continue
        if key.signal in ("sp", "stem") and missing.mean() > 0.5:
            note = f"{column.name} is missing at more than half of the rows, left out"
            rules.tell(note, block, note)
            columns = {k: c for k, c in columns.items() if k.signal != key.signal}
            continue
        short = missing if key.signal == "sp" else _short(missing)
        values = _carried(column.values, short, block.time, key)
        short = short & np.isfinite(values)
        held |= short & (key.signal != "sp")
        bad |= missing & ~short
        columns[key] = dataclasses.replace(column, values=values)
    held &= ~bad
    mask[held & (mask == Quality.GOOD)] = Quality.HELD
    mask[bad] = Quality.BAD
    if held.any():
        samples = plural(int(held.sum()), "sample")
        note = f"{samples} held over at most {HELD} in a row (PV between its neighbours)"
        rules.tell(note, block, f"{samples} missing in OP or PV")
    if (bad & ~given).any():
        note = f"{plural(int((bad & ~given).sum()), 'sample')} bad"
        rules.tell(f"{note}, cut out", block, note)
    return dataclasses.replace(block, columns=columns, mask=mask if mask.any() else None)


def _short(missing: FlagArray) -> FlagArray:
    """Return which missing values stand in stretches that are held, shape (N,)."""
    begins, ends = stretches(missing)
    found = np.zeros(len(missing), dtype=np.bool_)
    for first, last in zip(begins.tolist(), ends.tolist(), strict=True):
        inside = first > 0 and last < len(missing)
        found[first:last] = inside and last - first <= HELD
    return found


def _carried(values: FloatArray, wanted: FlagArray, time: FloatArray, key: Key) -> FloatArray:
    """Return values with the wanted ones held, or of PV and stem interpolated."""
    there = np.flatnonzero(np.isfinite(values))
    if not len(there):
        return values
    if key.signal in ("pv", "stem"):
        return np.where(wanted, np.interp(time, time[there], values[there]), values)
    before = np.searchsorted(there, np.arange(len(values)), side="right") - 1
    return np.where(wanted, values[there[np.maximum(before, 0)]], values)
