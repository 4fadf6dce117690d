"""The clocks of a loop's blocks put right: midnights, 12 hours, summer time.

Each block by itself, as in joined ones the two passes over an hour are one.
"""

import dataclasses
import functools
import zoneinfo
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError, foreign
from stiction_ros.intake.repairs import Rules, each
from stiction_ros.intake.tables.block import Block, FlagArray
from stiction_ros.intake.tables.clock import SPREADSHEET
from stiction_ros.intake.words import WORDS
from stiction_ros.texts import DAY, HOUR

FIX = "export the stamps in UTC or with their offset, such as 2024-10-27 02:00:00+01:00"
YEARS = SPREADSHEET[1] - SPREADSHEET[0]  # days from 1970 to 2099


class Change(NamedTuple):
    """A clock leaps from ``low`` to ``high``, or falls back and what lies between comes twice.

    Both are local, in s since 1970; ``before`` are the s that it was ahead of UTC until then.
    """

    low: float
    high: float
    back: bool
    before: float = 0.0

    @property
    def moves(self) -> float:
        """Seconds to add to what follows, for times that go on evenly."""
        return (self.high - self.low) * (1.0 if self.back else -1.0)

    @property
    def said(self) -> str:
        """What happens, as a note says it."""
        minutes = (self.high - self.low) / 60.0
        by = "an hour" if minutes == 60.0 else f"{minutes:g} min"
        way, at = ("back", self.high) if self.back else ("forward", self.low)
        return f"the clock is set {way} by {by} at {shown(at)}"


def changes(zone: str, days: FloatArray) -> list[Change]:
    """Return the changes of a zone between days since 1970, from first to last.

    Without a zone those on the days themselves, in the zones that ``words.yaml`` lists.
    """
    kept = np.unique(days[np.flatnonzero(np.diff(days, prepend=np.nan))]).clip(0.0, YEARS)
    if zone:
        kept = np.arange(kept[0], kept[-1] + 1.0)
    near = {int(day) + k for day in kept.tolist() for k in (-1, 0, 1)}
    zones = [zone] if zone else WORDS["summer_time"]
    found = {c[:3]: c for each in zones for day in near for c in _on(each, day)}
    return sorted(found.values())


def ahead(zone: str, second: float) -> float:
    """Return how many seconds the local time of a zone is ahead of UTC at a time."""
    moment = datetime.fromtimestamp(0, UTC) + timedelta(seconds=second)
    offset = moment.astimezone(zoneinfo.ZoneInfo(zone)).utcoffset()
    return offset.total_seconds() if offset is not None else 0.0


def shown(second: float) -> str:
    """Return a time, in s since 1970, as a stamp."""
    return str(datetime.fromtimestamp(0, UTC) + timedelta(seconds=round(second)))[:19]


@functools.lru_cache(1 << 16)
def _on(zone: str, day: int) -> tuple[Change, ...]:
    """Return the change on a day in UTC, if there is one."""
    first, last = round(DAY * day), round(DAY * (day + 1))
    before, after = ahead(zone, first), ahead(zone, last)
    if before == after:
        return ()
    while last - first > 1:
        middle = (first + last) // 2
        first, last = (middle, last) if ahead(zone, middle) == before else (first, middle)
    walls = sorted((last + before, last + after))
    return (Change(walls[0], walls[1], after < before, before),)


def put_right(blocks: Sequence[Block], rules: Rules) -> list[Block]:
    """Return blocks of one loop with times that go on evenly, in UTC where their zone is known.

    Raises:
        InputError: a clock of 12 hours without AM and PM, or rows of an hour that is passed twice
            that do not tell which pass they belong to.
    """
    found = each(each(blocks, rules, _turned), rules, _with_days)
    local = {k: b.clock.zone for k, b in enumerate(found) if b.clock.dated and not b.clock.zoned}
    for zone in dict.fromkeys(local.values()):
        places = [place for place, other in local.items() if other == zone]
        even = _in_one_time([found[place] for place in places], zone, rules)
        for place, block in zip(places, even, strict=True):
            found[place] = block
    return found


def _turned(block: Block, rules: Rules) -> Block:
    steps = np.diff(block.time)
    if not steps.any() or np.count_nonzero(steps < 0) <= 0.9 * np.count_nonzero(steps):
        return block
    note = "rows stood from the last to the first and are turned"
    rules.tell(note, "sort the rows", block.place(1))
    return block.rows(np.arange(len(block.time))[::-1])


def _with_days(block: Block, _: Rules) -> Block:
    """Return times of the day alone with midnights counted."""
    if block.clock.zoned or not (block.clock.dated or block.clock.daily):
        return block
    wall = block.clock.start + block.time
    hours = wall % DAY // HOUR
    halves = np.rint(np.diff(wall) / (0.5 * DAY))
    leaps = (halves == 2.0) & (hours[:-1] == 11.0) & (hours[1:] == 12.0)
    falls = np.flatnonzero((halves == -1.0) | leaps)
    if len(falls) and hours.min() >= 1.0 and hours.max() <= 12.0:
        row = int(falls[0]) + 1
        again = row + np.flatnonzero(np.isin(wall[row:], wall[:row]))[:1]
        stamps = [shown(wall[k])[11 * block.clock.daily :] for k in (row - 1, row, *again)]
        raise InputError(
            f"the clock has 12 hours, without AM and PM: {stamps[0]} is followed by {stamps[1]} in "
            f"{block.place(row)}{''.join(f', {stamp} is there twice' for stamp in stamps[2:])}",
            fix="export stamps with 24 hours, or with AM and PM",
        )
    if not block.clock.daily:
        return block
    midnights = np.diff(block.time, prepend=block.time[:1]) < -0.5 * DAY
    return dataclasses.replace(block, time=block.time + DAY * np.cumsum(midnights))


@dataclasses.dataclass(frozen=True)
class _Rows:
    """Local times of rows, s since 1970, by their rank in the file, shape (N,) each."""

    wall: FloatArray
    rank: NDArray[np.int64]

    @classmethod
    def of(cls, *blocks: Block) -> "_Rows":
        """Return the rows of blocks of one file, which may stand from the last to the first."""
        lines = [b.lines if b.lines[0] <= b.lines[-1] else -b.lines for b in blocks]
        wall, rank = np.concatenate([b.clock.start + b.time for b in blocks]), np.concatenate(lines)
        order = np.argsort(rank, kind="stable")
        return cls(wall[order], rank[order])

    @functools.cached_property
    def usual(self) -> float:
        """The usual step, s."""
        steps = np.diff(self.wall)
        return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0

    def seams(self, change: Change) -> NDArray[np.intp]:
        """Return the rows before which a change sets the clock, by more than half of it."""
        steps, (low, high) = np.diff(self.wall), change[:2]
        first, then = self.wall[:-1], self.wall[1:]
        if change.back:
            found = (first > low) & (first <= high) & (then >= low) & (then < high) & (steps <= 0)
        else:
            found = (first <= low) & (then >= high)
        found &= np.rint((self.usual - steps) / change.moves) == 1.0
        return np.flatnonzero(found) + 1

    def is_doubled(self, change: Change) -> bool:
        """Tell whether both passes stand between each other: twice as many rows as elsewhere."""
        wall = np.sort(self.wall)
        inside = (wall >= change.low) & (wall < change.high)
        steps = np.diff(wall)[~inside[1:]] if not inside.all() else np.diff(wall)
        if not (steps > 0).any() or np.count_nonzero(inside) < 3:
            return False
        both, usual = wall[2:] - wall[:-2], float(np.median(steps[steps > 0]))
        whole, none = inside[2:] & inside[:-2], ~inside[2:] & ~inside[:-2]
        twice = bool(np.rint(np.median(both[whole]) / usual) <= 1.0)
        return twice and not (none.any() and np.rint(np.median(both[none]) / usual) <= 1.0)


def _in_one_time(blocks: Sequence[Block], zone: str, rules: Rules) -> list[Block]:
    """Return dated blocks of one local time with what follows each change of their clock moved."""
    rows = [_Rows.of(block) for block in blocks]
    known = changes(zone, np.concatenate([one.wall // DAY for one in rows]))
    if not zone:
        known += dict.fromkeys(change for one in rows for change in _others(one, known))
    paths = dict.fromkeys(block.path for block in blocks)
    files = {path: _Rows.of(*(b for b in blocks if b.path == path)) for path in paths}
    shifts = [np.zeros(len(one.wall)) for one in rows]
    for change in known:
        seen = any(len(one.seams(change)) for one in (*rows, *files.values()))
        if not zone and change.back and not seen:
            for block, one in zip(blocks, rows, strict=True):
                if one.is_doubled(change):
                    raise _untold(block, change)
        left_out = any(((r.wall > change.low) & (r.wall < change.high)).any() for r in rows)
        if not zone and (not seen or (left_out and not change.back)):
            continue
        count = 0
        for block, one, shift in zip(blocks, rows, shifts, strict=True):
            moved = _after(block, (one, files[block.path]), change)
            shift[moved] += change.moves
            count += int(np.count_nonzero(moved))
        way = "on, both passes are kept" if change.back else "back"
        note = f"{change.said}: {count} rows that follow are moved {way}"
        if not zone:
            with foreign(blocks[0].path):
                rules.tell(note, FIX)
        elif change.back and seen:
            rules.told.append(note)
    early = 0.0
    if zone:
        early = known[0].before if known else ahead(zone, float(rows[0].wall[0]))
    return [
        dataclasses.replace(
            block,
            time=block.time + shift,
            clock=block.clock._replace(start=block.clock.start - early, zone="", zoned=bool(zone)),
        )
        for block, shift in zip(blocks, shifts, strict=True)
    ]


def _others(one: _Rows, known: Sequence[Change]) -> list[Change]:
    """Return the one fall by an hour, within half a step, that no calendar has."""
    back = np.flatnonzero(np.diff(one.wall) < 0.0)
    if len(back) != 1 or any(len(one.seams(change)) for change in known):
        return []
    first, then = one.wall[back[0]], one.wall[back[0] + 1]
    off = min(abs(first + usual - then - HOUR) for usual in (0.0, one.usual))
    return [Change(float(then), float(then) + HOUR, back=True)] if off <= 0.5 * one.usual else []


def _after(block: Block, told: Sequence[_Rows], change: Change) -> FlagArray:
    """Return the rows of a block that follow a change."""
    wall, (low, high) = block.clock.start + block.time, change[:2]
    if not change.back:
        return wall >= high
    for rows in told:
        if len(seams := rows.seams(change)) == 1:
            late = _Rows.of(block).rank >= rows.rank[seams[0]]
            return np.asarray((wall > high) | (wall >= low) & late)
    inside = (wall >= low) & (wall < high)
    if inside.any():
        raise _untold(block, change)
    return wall >= high


def _untold(block: Block, change: Change) -> InputError:
    return InputError(
        f"{change.said}, and the rows from {shown(change.low)[11:]} on do not tell which of the "
        "two passes they belong to",
        where=str(block.path),
        fix=FIX,
    )
