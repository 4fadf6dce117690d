"""Cells of a column of times, in any of the forms that historians write."""

import dataclasses
import datetime
import enum
import functools
import re
import unicodedata
import zoneinfo
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.sheets.cells import SHOWN, Cells, Numbers, is_number
from stiction_ros.intake.sheets.names import OR_ROW
from stiction_ros.intake.words import by_word

DAY = 86_400_000_000  # microseconds of a day


class _No(enum.IntEnum):
    """In the place of a date: an empty cell, and one that is not understood."""

    EMPTY = -1
    STRANGE = -2


_MONTHS, _OFFSETS, _HALVES = by_word("months"), by_word("zones"), by_word("half_days")

_SEP = r"(?:\.?[./-]|\.?,?\s+(?:del?\s+)?)"
_DATE = re.compile(
    r"((?:19|20)\d\d)(\d\d)(\d\d)(?=[T ]\d|\d{4}(?:\d\d)?(?!\d))|"
    rf"(\d{{1,4}}|[^\W\d_]{{3,}})({_SEP})(\d{{1,2}}|[^\W\d_]{{3,}}){_SEP}(\d{{1,4}})(?![\d:])"
)
_HALF = "|".join(r"\.?\s?".join(word.replace(" ", "")) + r"\.?" for word in _HALVES)
_CLOCK = re.compile(
    r"[T,;:_-]?\s*(?:"
    r"(\d{1,2})(?:[:.h]|(?<=\d\d)(?=\d\d))(\d{1,2})"
    r"(?:(?:[:.]|(?<=\d{4})(?=\d\d))(\d{1,2})(?:[.,:](\d{1,9}))?)?"
    rf"(?:\s*({_HALF})(?![^\W\d_]))?"
    r"\s*((?:(?:UTC|GMT)?[+-]\d{1,2}(?::?\d\d)?)?\s*(?:[\[(]?[a-z][\w/+-]*[\])]?)?))?",
    re.IGNORECASE,
)
_ISO = re.compile(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d(\.\d{1,9})?)?)?")
_OFFSET = re.compile(r"(?:UTC|GMT)?([+-])(\d{1,2}):?(\d\d)?(?![^\W\d_])", re.IGNORECASE)


class DateOrder(enum.StrEnum):
    """Which comes first in a date such as 01/02/2024."""

    DAY = "dmy"
    MONTH = "mdy"


class Clock(NamedTuple):
    """What times are counted from."""

    start: float  # the first time; seconds since 1970 in UTC for dates, else as given
    dated: bool = False  # whether it is a date
    zoned: bool = False  # whether its zone is known
    zone: str = ""  # whose local time it is, where that is not yet brought to UTC; else empty
    daily: bool = False  # whether it counts from midnight each day


class Wrong(NamedTuple):
    """The first cell that is no time: its row, and the cell, or what is said of it."""

    row: int
    said: str


class Times(NamedTuple):
    """A column of times."""

    # since the first that is one, shape (N,); NaN where the cell is empty, infinite where it is not
    # understood
    seconds: FloatArray
    clock: Clock  # that they are counted on
    wrong: Wrong | None = None  # first cell that is not understood, else the first empty one
    note: str = ""  # how they were read, empty for the usual way


class _Date(NamedTuple):
    """Day since 1970 of a date in each order, None where it is none; whether they may differ."""

    dmy: int | None
    mdy: int | None
    asked: bool = False


@dataclasses.dataclass
class Stamps:
    """A column of times as it grows; days or months may come first in ``order``, None finds out."""

    decimal_comma: bool = False
    order: DateOrder | None = None
    _numbers: Numbers | None = None
    _dates: dict[str, int] = dataclasses.field(default_factory=lambda: {"": 0, "1970-01-01": 1})
    _days: list[_Date] = dataclasses.field(default_factory=lambda: 2 * [_Date(0, 0)])
    _zones: dict[str, int] = dataclasses.field(default_factory=lambda: {"": 0})
    _pieces: list[tuple[NDArray[np.int64], ...]] = dataclasses.field(default_factory=list)
    _firsts: dict[int, Wrong] = dataclasses.field(default_factory=dict)
    _told: bool = False
    _rows: int = 0

    def add(self, cells: Cells) -> None:
        """Add the next piece of the column."""
        if isinstance(cells, np.ndarray) and cells.dtype.kind == "M":
            whole = cells.astype("datetime64[us]")
            self._keep(np.where(np.isnat(whole), _No.EMPTY, 1), whole.astype(np.int64), 0)
        elif isinstance(cells, np.ndarray) or self._numbers is not None or self._is_numbers(cells):
            if self._numbers is None:
                self._numbers = Numbers(self.decimal_comma)
                self._numbers.add([""] * self._rows)
            self._numbers.add(cells)
        elif not self._iso(cells):
            self._other(cells)
        self._rows += len(cells)

    def times(self) -> Times:
        """Return the whole column.

        Raises:
            InputError: dates of which days and months cannot be told apart, or a zone that is
                not known.
        """
        if self._numbers is not None:
            read = self._numbers.values()
            strange = ~np.isfinite(read) & ~self._numbers.blank()
            if strange.any():
                row = int(np.argmax(strange))
                self._firsts[_No.STRANGE] = Wrong(row, self._numbers.words[row])
            values = np.where(strange, np.inf, read)
            first = float(values[np.argmax(np.isfinite(values))]) if len(values) else 0.0
            first = first if np.isfinite(first) else 0.0
            return Times(values - first, Clock(first), self._wrong(values))
        days, clocks, of = map(np.concatenate, zip(*self._pieces, strict=True))
        daily = not (days > 0).any()
        if not daily:  # a time of the day alone is no stamp among dates
            days[days == 0] = _No.STRANGE
            lone = [self._firsts.pop(day) for day in (0, _No.STRANGE) if day in self._firsts]
            self._firsts.update({_No.STRANGE: min(lone)} if lone else {})
        numbered, note = self._day_numbers(days, clocks)
        there = days >= 0
        offsets, zone = self._offsets(of[there])
        stamps = DAY * numbered[days] + clocks - offsets[of]
        first = int(stamps[np.argmax(there)]) if there.any() else 0
        seconds = (stamps - first) / 1e6
        seconds[days == _No.EMPTY], seconds[days == _No.STRANGE] = np.nan, np.inf
        zoned = not zone and bool(of[there].any())
        clock = Clock(first / 1e6, not daily, zoned, zone, daily)
        return Times(seconds, clock, self._wrong(seconds), note)

    def _is_numbers(self, cells: Sequence[str]) -> bool:
        if self._told:
            return False
        filled = [cell.strip() for cell in cells if cell.strip()]
        self._told = bool(filled)
        if filled and _ISO.match(filled[0]):
            return False
        count = sum(is_number(cell) and not _DATE.match(cell) for cell in filled)
        return 2 * count >= len(filled) > 0

    def _iso(self, cells: Sequence[str]) -> bool:
        """Add ISO stamps that have the same form and zone; False when they have not."""
        found = _ISO.match(cells[0])
        clock = found and _clock(f"0:00{(tail := cells[0][found.end() :])}")
        if not clock or clock[0]:
            return False
        if tail:
            if not all(cell.endswith(tail) for cell in cells):
                return False
            cells = [cell[: -len(tail)] for cell in cells]
        text = "".join(cells)
        if "Z" in text or "+" in text or text.count("-") != 2 * len(cells):
            return False
        try:
            stamps = np.array(cells, dtype="datetime64[us]")
        except ValueError:
            return False
        self._keep(1, stamps.astype(np.int64), self._zones.setdefault(clock[1], len(self._zones)))
        return True

    def _other(self, cells: Sequence[str]) -> None:
        days = np.full(len(cells), _No.EMPTY, dtype=np.int64)
        clocks, zones = np.zeros((2, len(cells)), dtype=np.int64)
        known: dict[str, tuple[int, str] | None] = {}
        for row, given in enumerate(cells):
            cell = given.strip()
            if not cell:
                continue
            date, rest = _cut(cell)
            if rest not in known:
                known[rest] = _clock(rest)
            if date not in self._dates:
                read = _date(date)
                self._dates[date] = _No.STRANGE if read is None else len(self._days)
                self._days += [] if read is None else [read]
            day, clock = self._dates[date], known[rest]
            if clock is not None:
                clocks[row] = clock[0]
                zones[row] = self._zones.setdefault(clock[1], len(self._zones))
            days[row] = day = _No.STRANGE if clock is None else day
            if day in (0, _No.STRANGE) and day not in self._firsts:
                self._firsts[day] = Wrong(self._rows + row, cell)
        self._keep(days, clocks, zones)

    def _keep(self, days: Any, clocks: NDArray[np.int64], zones: Any) -> None:
        self._pieces.append(tuple(np.broadcast_arrays(days, clocks, zones)))

    def _day_numbers(
        self, days: NDArray[np.int64], clocks: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], str]:
        """Return the day since 1970 of each date, and how they were read."""
        orders = [self.order] if self.order else list(DateOrder)
        every = {order: [getattr(date, order) for date in self._days] for order in orders}
        found = {o: np.array(read) for o, read in every.items() if None not in read}
        asked = [text for text, at in self._dates.items() if at > 1 and self._days[at].asked]
        if not found:
            texts = {place: text for text, place in self._dates.items()}
            none = dict.fromkeys(texts[read.index(None)] for read in every.values())
            raise InputError(
                f"{' and '.join(none)} are not dates in one order of days and months",
                fix="export ISO stamps such as 2024-10-17 21:55:00",
            )
        if len(found) > 1:
            found = _steadier(found, days, clocks)
        if len({tuple(read) for read in found.values()}) > 1:
            raise InputError(
                f"{asked[0]} may begin with the day or with the month",
                fix=f"say which with --dates dmy or --dates mdy {OR_ROW}",
            )
        order, read = next(iter(found.items()))
        first = "day" if order is DateOrder.DAY else "month"
        return read, "" if self.order or not asked else f"dates are read with the {first} first"

    def _offsets(self, of: NDArray[np.int64]) -> tuple[NDArray[np.int64], str]:
        """Return the µs that each zone is before UTC, and the one whose local time all are."""
        used = [text for text, place in self._zones.items() if (of == place).any()]
        read = {text: _zone(text) for text in used}
        named = {text: zone for text, zone in read.items() if isinstance(zone, str)}
        if len(used) > 1 and ("" in used or (named and len(set(read.values())) > 1)):
            raise InputError(
                f"stamps bear several zones: {' and '.join(text or 'none' for text in used[:2])}",
                fix="export all of them in one, such as UTC",
            )
        offsets = np.zeros(len(self._zones), dtype=np.int64)
        for text, zone in read.items():
            offsets[self._zones[text]] = 0 if isinstance(zone, str) else zone
        return offsets, next(iter(named.values()), "")

    def _wrong(self, seconds: FloatArray) -> Wrong | None:
        if (first := self._firsts.get(_No.STRANGE)) is not None:
            shown = f"is {first.said[:SHOWN]!r}, neither seconds nor a stamp that is known,"
            return first._replace(said=shown)
        missing = np.isnan(seconds)
        return Wrong(int(np.argmax(missing)), "is empty") if missing.any() else None


def is_stamp(cell: str) -> bool:
    """Return whether a cell is a date or a time of the day."""
    date, clock = _cut(cell.strip())
    known = bool(date and _date(date)) or (not date and ":" in clock)
    return known and _clock(clock) is not None


def _cut(cell: str) -> tuple[str, str]:
    """Return the date of a cell, empty for none, and what stands behind it."""
    found = _DATE.match(cell)
    if found is None:
        return "", cell
    date = found[0] if found[1] is None else f"{found[1]}-{found[2]}-{found[3]}"
    return date, cell[found.end() :]


def _clock(text: str) -> tuple[int, str] | None:
    """Return microseconds since midnight and the zone; None for anything else."""
    found = _CLOCK.fullmatch(text)
    if found is None or (found[1] is None and text):
        return None
    hours, minutes, seconds = int(found[1] or 0), int(found[2] or 0), int(found[3] or 0)
    if found[5]:
        if not 1 <= hours <= 12:
            return None
        afternoon = _HALVES[re.sub(r"[.\s]", "", found[5]).casefold()] == "pm"
        hours = hours % 12 + (12 if afternoon else 0)
    if hours > 24 or minutes > 59 or seconds > 60:
        return None
    micros = int((found[4] or "").ljust(6, "0")[:6])
    return 1_000_000 * (3600 * hours + 60 * minutes + seconds) + micros, found[6] or ""


def _zone(text: str) -> int | str:
    """Return how many microseconds a zone is before UTC, or its name where that changes."""
    name = text.strip("[]() ")
    offset = _OFFSET.match(_OFFSETS.get(name.upper(), name or "+0"))
    if offset is not None:
        minutes = 60 * int(offset[2]) + int(offset[3] or 0)
        return 60_000_000 * (-minutes if offset[1] == "-" else minutes)
    try:
        return zoneinfo.ZoneInfo(name).key
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        raise InputError(
            f"zone {name} of the stamps is unknown, or several zones have this name",
            fix="write its offset, such as +02:00, or a name such as Europe/Berlin",
        ) from None


def _date(date: str) -> _Date | None:
    """Return what a date is; None when it is none."""
    found = _DATE.fullmatch(date)
    if found is None:
        return None
    a, mark, b, c = found.group(4, 5, 6, 7)
    if b.isdigit() and not a.isdigit():
        a, b = b, a
    a, c = (c, a) if len(a) > 2 else (a, c)
    if len(c) not in (2, 4) or len(a) > 2 or not (a.isdigit() and c.isdigit()):
        return None
    month = int(b) if b.isdigit() else _month(b)
    year = int(c) + (0 if len(c) > 2 else 2000 if int(c) < 70 else 1900)
    asked = b.isdigit() and len(found[4]) < 3 and not mark.startswith(".")
    first = _day(year, month, int(a))
    other = _day(year, int(a), month) if asked else first
    return None if first is None and other is None else _Date(first, other, asked)


@functools.cache
def _month(word: str) -> int:
    """Return the one month of which the name begins with a word; 0 for none."""
    plain = unicodedata.normalize("NFKD", word.casefold())
    plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    found = {month for name, month in _MONTHS.items() if name.startswith(plain)}
    return found.pop() if len(found) == 1 else 0


def _day(year: int, month: int, day: int) -> int | None:
    """Return the day since 1970; None when there is none."""
    try:
        return (datetime.date(year, month, day) - datetime.date(1970, 1, 1)).days
    except ValueError:
        return None


def _steadier(
    found: dict[DateOrder, NDArray[np.int64]], days: NDArray[np.int64], clocks: NDArray[np.int64]
) -> dict[DateOrder, NDArray[np.int64]]:
    """Return the one order in which time goes on evenly; all when that does not tell."""
    there = days >= 0
    longest = {
        order: int(np.max(np.abs(np.diff(DAY * read[days[there]] + clocks[there])), initial=0))
        for order, read in found.items()
    }
    best = min(longest, key=lambda order: longest[order])
    return {best: found[best]} if 3 * longest[best] < max(longest.values()) else found
