"""What is wrong with the rows of a loop: told, counted, left out or taken as missing."""

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError, foreign
from stiction_ros.intake.tables.block import Block, Column, FlagArray, Key
from stiction_ros.intake.words import WORDS
from stiction_ros.records.record import Quality
from stiction_ros.records.regular import HELD, begun_anew, sample_time, spread_evenly
from stiction_ros.signals.holds import stretches
from stiction_ros.texts import plural

FAR = 5.0  # how many times the range of all other values a value is away that cannot belong to them
SENTINEL_FAR = 0.5  # the same for numbers that stand for bad values

SENTINELS: tuple[float, ...] = tuple(WORDS["sentinels"])
"""Numbers that loggers and controllers write in the place of a bad value."""

FEWEST_USUAL = 10  # values from which on it can be told that another one does not belong to them
RARE = 0.2  # share of a signal that may lie far outside
FEW = 0.01  # share of stamps that may be left out as not understood

FORMS = (
    "write times as 2024-10-17 21:55:00, 17.10.2024 21:55, 10/17/2024 9:55 PM, 17 Oct 2024 21:55 "
    "or 20241017215500, with or without a zone such as Z, +02:00, CET or Europe/Berlin"
)
"""How to mend stamps that are not understood."""

FIX = "correct it, fill it or cut the record there"


@dataclasses.dataclass(frozen=True)
class Rules:
    """Whether anything wrong is an error, what was done, and what words of a mode are taken for."""

    strict: bool
    told: list[str] = dataclasses.field(default_factory=list)
    modes: dict[str, str] = dataclasses.field(default_factory=dict)

    def tell(self, note: str, fix: str = FIX, at: str = "") -> None:
        """Note what is repaired; strict, raise an :class:`InputError` that says where first."""
        if self.strict:
            raise InputError(f"needs a repair: {note}{f', first: {at}' if at else ''}", fix=fix)
        self.told.append(note)


def each(
    blocks: Sequence[Block], rules: Rules, mend: Callable[[Block, Rules], Block]
) -> list[Block]:
    """Return blocks mended by a rule; errors name the file of theirs."""
    mended = []
    for block in blocks:
        with foreign(block.path):
            mended.append(mend(block, rules))
    return mended


def with_times(block: Block, rules: Rules) -> Block:
    """Return the rows that have a time; InputError if none, or more than ``FEW`` are strange."""
    there, strange = np.isfinite(block.time), int(np.count_nonzero(np.isinf(block.time)))
    lost = len(there) - int(np.count_nonzero(there))
    if not lost:
        return block
    said = f"{plural(strange, 'stamp')} of {len(there)} not understood, the first: {block.stray}"
    if strange > FEW * len(there) or lost == len(there):
        fix = f"{FORMS}; or choose the column with --time COLUMN"
        raise InputError(said if strange else block.stray, fix=fix)
    if strange:
        rules.tell(f"{said}, left out")
    if lost > strange:
        rules.tell(f"{plural(lost - strange, 'row')} without a time left out", at=block.stray)
    return block.rows(there)


def with_values(block: Block, rules: Rules, *, shared: bool) -> Block:
    """Return the rows in which OP, PV, SP or the stem has a value, be it a bad one.

    Rows that are ``shared`` with other loops say nothing of this one, and no note tells of them.
    """
    empty = np.all([column.blank for column in block.measured.values()], axis=0)
    empty &= block.own_mask() != Quality.BAD
    if not empty.any() or empty.all():
        return block
    if not shared:
        row = int(np.argmax(empty))
        note = f"{plural(int(empty.sum()), 'row')} without any value left out"
        rules.tell(note, at=block.place(row))
    return block.rows(~empty)


def checked(block: Block, rules: Rules) -> Block:
    """Return the block with what is no number counted."""
    for key, column in block.measured.items():
        missing = ~np.isfinite(column.values) & (block.own_mask() != Quality.BAD)
        if missing.all() and key.signal in ("op", "pv"):
            shown = " ".join(repr(word) for word, _ in column.words.most_common(2) if word)
            raise InputError(
                f"column {column.name} holds no number{f', but {shown}' if shown else ''}",
                fix="choose others with --op TAG=COLUMN --pv TAG=COLUMN, or tags with --tags F",
            )
        if not missing.any():
            continue
        rules.tell(
            f"{column.name}: {plural(int(missing.sum()), 'value')} of {len(missing)} "
            f"missing{_listed(column, missing)}",
            at=block.place(int(np.argmax(missing))),
        )
    return block


def _listed(column: Column, missing: FlagArray) -> str:
    """Return what stands in the place of missing values, with counts where these are known."""
    # Words are counted over all rows of the file, of which those without a time are left out.
    words = Counter({word: count for word, count in column.words.items() if word and count})
    empty = int(np.count_nonzero(missing & column.blank))
    counted = words.total() + empty <= np.count_nonzero(missing)
    told = [f"{count} {word!r}" if counted else repr(word) for word, count in words.most_common(4)]
    told += [f"{empty} empty"] if empty else []
    return f" ({', '.join(told)})" if told else ""


def in_order(block: Block, rules: Rules, *, alone: bool = True) -> list[Block]:
    """Return the rows with increasing stamps; several blocks when the clock of one began anew."""
    time = block.time
    steps = np.diff(time)
    if (steps > 0).all():
        return [block]
    if rules.strict:
        sample_time(block.clock.start + time, str(block.path), block.place)  # tells which row
    back = np.flatnonzero(steps < 0)
    if alone and len(back) and len(back) <= 0.001 * len(time) + 3:
        runs = begun_anew(time, max(10, math.ceil(0.02 * len(time))))
        if len(runs) > 1 and not block.clock.dated:
            rules.told.append(f"time begins anew: {len(runs)} runs")
            return [one for run in runs for one in in_order(block.rows(run), rules)]
    order = np.argsort(time, kind="stable")
    if len(back):
        rules.told.append(f"{plural(len(back), 'row')} out of order sorted")
    return [_without_repeats(block.rows(order), rules)]


def _without_repeats(block: Block, rules: Rules) -> Block:
    """Return the last row of each stamp, with what earlier ones have where it has nothing."""
    last = np.append(np.diff(block.time) > 0, True)
    if last.all():
        return block
    begins = np.insert(last[:-1], 0, True)
    first, group = np.flatnonzero(begins), np.cumsum(begins) - 1
    moved = np.ptp(np.sign(np.diff(block.lines))) > 0
    signals = [column.values for column in block.of("op", "pv").values()]
    spread = None if moved else spread_evenly(block.time, first, signals)
    if spread is not None:
        rules.told.append(spread[1])
        return dataclasses.replace(block, time=spread[0])
    differing = 0
    columns: dict[Key, Column] = {}
    for key, column in block.columns.items():
        here = np.flatnonzero(~column.blank)
        values = np.full(len(first), np.nan)
        blank = np.ones(len(first), dtype=np.bool_)
        values[group[here]] = column.values[here]
        blank[group[here]] = False
        there = here[np.isfinite(column.values[here])]
        differing += int(np.count_nonzero(column.values[there] != values[group[there]]))
        columns[key] = dataclasses.replace(column, values=values, blank=blank)
    of = f"{next(iter(columns.values())).name}: " if len(columns) == 1 else ""
    said = f"{of}{plural(len(last) - len(first), 'row')} with the time stamp of an earlier row"
    done = f"the last value counts, {differing} differ" if differing else "left out"
    rules.tell(f"{said}: {done}", "remove those that are there twice")
    return dataclasses.replace(block.rows(last), columns=columns)


def without_outliers(block: Block, rules: Rules) -> Block:
    """Return OP, PV and SP with NaN where a value is far outside everything else."""
    columns = {}
    for key, column in block.measured.items():
        far = outside(column.values)
        if not far.any():
            continue
        row = int(np.argmax(far))
        worst = f"{column.values[row]:g}"
        rules.tell(
            f"{column.name}: {plural(int(far.sum()), 'value')} such as {worst} far outside "
            "all others taken as missing",
            at=block.place(row),
        )
        columns[key] = dataclasses.replace(column, values=np.where(far, np.nan, column.values))
    return block.with_columns(columns)


def outside(values: FloatArray) -> FlagArray:
    """Return which values are sentinels or stray far from all others, shape (N,)."""

    def far(low: float, high: float, times: float) -> FlagArray:
        room = times * max(high - low, 1e-3 * abs(high), 1e-12)
        return (values < low - room) | (values > high + room)

    there = np.isfinite(values)
    found = np.zeros(len(values), dtype=np.bool_)
    known = np.isin(values, SENTINELS)
    rest = values[there & ~known]
    if known.any() and len(rest) and len(values) > FEWEST_USUAL:
        found |= known & far(float(rest.min()), float(rest.max()), SENTINEL_FAR)
    usual = values[there & ~found]
    if len(usual) >= FEWEST_USUAL:
        low, high = np.percentile(usual, [1.0, 99.0]).tolist()
        stray = there & ~found & far(low, high, FAR)
        begins, ends = stretches(stray[there])
        # Where they do not come alone the signal was that far out.
        if np.max(ends - begins, initial=0) <= HELD and stray.sum() <= 0.02 * there.sum():
            found |= stray
    return found if np.count_nonzero(found) <= RARE * len(values) else np.zeros_like(found)
