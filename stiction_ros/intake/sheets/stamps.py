"""Cells of a column of times, in any of the forms that historians write."""

from __future__ import annotations

import dataclasses
import datetime
import enum
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.sheets.cells import SHOWN, Cells, Numbers, Wrong, number
from stiction_ros.intake.sheets.names import OR_ROW
from stiction_ros.intake.words import by_word

DAY = 86400.0

_MONTHS: Mapping[str, int] = by_word("months")
"""First letters of the months in several languages."""

_DATE = re.compile(r"(\d{1,4})([./-])(\d{1,2}|[^\W\d_]{3,9}\.?)[./-](\d{2,4})")
_CLOCK = re.compile(
    r"(\d{1,2})[:.](\d\d)(?:[:.](\d\d)(?:[.,:](\d{1,9}))?)?\s*([ap])?\.?(?:m\.?)?", re.IGNORECASE
)
_ZONE = re.compile(r"(?:Z|[+-]\d\d:?\d\d)$")


_OFFSETS: Mapping[str, str] = by_word("zones")
"""Zones by their names, of which each is one alone."""

_NAMED = re.compile(rf"\s*\b({'|'.join(_OFFSETS)})$")


class DateOrder(enum.StrEnum):
    """Which comes first in a date such as 01/02/2024."""

    DAY = "dmy"
    MONTH = "mdy"


class Times(NamedTuple):
    """A column of times.

    Attributes:
        seconds: since the first that is one, shape (N,), NaN where there is none.
        start: the first one; seconds since 1970 in UTC for dates, else as given.
        dated: whether they are dates.
        zoned: whether they bear a zone.
        wrong: first cell that is no time.
        note: how they were read, empty for the usual way.
    """

    seconds: FloatArray
    start: float
    dated: bool
    zoned: bool
    wrong: Wrong | None
    note: str


@dataclasses.dataclass
class Stamps:
    """A column of times as it grows; its first cell tells what the others are.

    Attributes:
        decimal_comma: of numbers.
        order: of days and months, None to find out.
    """

    decimal_comma: bool = False
    order: DateOrder | None = None
    _numbers: Numbers | None = None
    _iso: list[NDArray[np.int64]] = dataclasses.field(default_factory=list)
    _dates: dict[str, int] = dataclasses.field(default_factory=dict)
    _days: list[NDArray[np.int32]] = dataclasses.field(default_factory=list)
    _clocks: list[FloatArray] = dataclasses.field(default_factory=list)
    _kind: str = ""
    _rows: int = 0
    _zoned: bool = False
    _wrong: Wrong | None = None

    def add(self, cells: Cells) -> None:
        """Add the next piece of the column."""
        if not isinstance(cells, np.ndarray):
            cells = _with_offsets(cells)
        if not self._kind:
            self._kind = self._told(cells)
        if self._kind == "number":
            if self._numbers is None:
                self._numbers = Numbers(self.decimal_comma)
            self._numbers.add(cells)
        elif self._kind == "iso":
            self._iso.append(self._iso_stamps(cells))
        else:
            self._other(cells)
        self._rows += len(cells)

    def times(self, where: str) -> Times:
        """Return the whole column.

        Raises:
            InputError: dates of which days and months cannot be told apart.
        """
        if self._kind == "number" and self._numbers is not None:
            return self._finished(self._numbers.values(), self._numbers.wrong)
        if self._kind == "iso":
            return self._from_microseconds(np.concatenate(self._iso), "")
        days, clocks = np.concatenate(self._days), np.concatenate(self._clocks)
        numbered, note = self._day_numbers(days, clocks, where)
        seconds = np.where(days >= 0, DAY * numbered[days], np.nan) + clocks
        if set(self._dates) == {""}:  # times of day alone: each fall is a midnight
            return self._finished(_over_midnights(seconds), self._wrong)
        microseconds = np.full(len(seconds), np.iinfo(np.int64).min)
        there = np.isfinite(seconds)
        microseconds[there] = np.rint(1e6 * seconds[there]).astype(np.int64)
        return self._from_microseconds(microseconds, note)

    def _told(self, cells: Cells) -> str:
        if isinstance(cells, np.ndarray):
            return "iso" if cells.dtype.kind == "M" else "number"
        first = next((cell.strip() for cell in cells if cell.strip()), "")
        if number(first) is not None or number(first.replace(",", ".")) is not None:
            compact = re.fullmatch(r"(19|20)\d{6}(\d{4}|\d{6})", first)
            return "other" if compact else "number"
        return "iso" if _iso(first) is not None else "other"

    def _iso_stamps(self, cells: Cells) -> NDArray[np.int64]:
        """Return microseconds since 1970 in UTC, shape (n,), the least integer for none."""
        if isinstance(cells, np.ndarray):
            self._zoned = True
            return np.asarray(cells.astype("datetime64[us]").astype(np.int64))
        fast = self._iso_fast(cells)
        if fast is not None:
            return fast
        found = np.empty(len(cells), dtype=np.int64)
        for row, cell in enumerate(cells):
            stamp = _iso(cell.strip())
            if stamp is None:
                self._note(row, cell.strip())
                found[row] = np.iinfo(np.int64).min
                continue
            self._zoned |= stamp.tzinfo is not None
            found[row] = _microseconds(stamp)
        return found

    def _iso_fast(self, cells: Sequence[str]) -> NDArray[np.int64] | None:
        """Return the stamps when all have the same form and zone; None when they have not."""
        zone = _ZONE.search(cells[0]) if cells else None
        shift = 0
        if zone is not None:
            tail = zone[0]
            if not all(cell.endswith(tail) for cell in cells):
                return None
            stamp = _iso(cells[0])
            offset = None if stamp is None else stamp.utcoffset()
            shift = 0 if offset is None else offset // datetime.timedelta(microseconds=1)
            cells = [cell[: -len(tail)] for cell in cells]
        text = "".join(cells)
        if "Z" in text or "+" in text or any("-" in cell[10:] for cell in cells):
            return None  # zones that are not the same in all
        try:
            found = np.array(cells, dtype="datetime64[us]")
        except ValueError:
            return None
        if np.isnat(found).any():
            return None
        self._zoned |= zone is not None
        return np.asarray(found.astype(np.int64) - shift)

    def _other(self, cells: Cells) -> None:
        days = np.full(len(cells), -1, dtype=np.int32)
        clocks = np.full(len(cells), np.nan)
        known: dict[str, float | None] = {}
        for row, cell in enumerate(cells):
            date, clock = _split(str(cell).strip())
            if clock not in known:
                known[clock] = _clock(clock)
            seconds = known[clock]
            if seconds is None or (date and _parts(date) is None):
                self._note(row, str(cell).strip())
                continue
            days[row] = self._dates.setdefault(date, len(self._dates))
            clocks[row] = seconds
        self._days.append(days)
        self._clocks.append(clocks)

    def _day_numbers(
        self, days: NDArray[np.int32], clocks: FloatArray, where: str
    ) -> tuple[FloatArray, str]:
        """Return the day since 1970 of each date, and how they were read."""
        parts = [_parts(date) or (1970, "", 1, 1) for date in self._dates]
        if not parts:
            return np.zeros(1), ""
        if not any(mark == "?" for _, mark, _, _ in parts):
            return np.array([_day(year, b, a) for year, _, a, b in parts]), ""
        orders = [self.order] if self.order else list(DateOrder)
        found = {order: read for order in orders if (read := _read(parts, order)) is not None}
        if not found:
            raise InputError(
                f"dates such as {next(iter(self._dates))} are none", where=where,
                fix="export ISO stamps such as 2024-10-17 21:55:00",
            )  # fmt: skip
        if len(found) > 1:
            found = _steadier(found, days, clocks)
        if len(found) > 1 and len({tuple(read) for read in found.values()}) > 1:
            raise InputError(
                f"{next(iter(self._dates))} may begin with the day or with the month",
                where=where,
                fix=f"say which with --dates dmy or --dates mdy {OR_ROW}",
            )
        order, read = next(iter(found.items()))
        first = "day" if order is DateOrder.DAY else "month"
        note = "" if self.order else f"dates are read with the {first} first"
        return read, note

    def _note(self, row: int, text: str) -> None:
        if self._wrong is None:
            said = f"is {text[:SHOWN]!r}, neither seconds nor an ISO stamp" if text else "is empty"
            self._wrong = Wrong(self._rows + row, said)

    def _from_microseconds(self, stamps: NDArray[np.int64], note: str) -> Times:
        there = stamps != np.iinfo(np.int64).min
        if not there.any():
            return self._finished(np.full(len(stamps), np.nan), self._wrong)
        first = int(stamps[np.argmax(there)])
        seconds = np.where(there, (stamps - first) / 1e6, np.nan)
        return Times(seconds, first / 1e6, True, self._zoned, self._wrong, note)

    def _finished(self, values: FloatArray, wrong: Wrong | None) -> Times:
        there = np.isfinite(values)
        first = float(values[np.argmax(there)]) if there.any() else 0.0
        return Times(values - first, first, False, False, wrong, "")


def _with_offsets(cells: Sequence[str]) -> Sequence[str]:
    """Return stamps with the offset of a zone that is named behind them."""
    if not any(_NAMED.search(cell.strip()) for cell in (*cells[:1], *cells[-1:])):
        return cells
    return [_NAMED.sub(lambda found: _OFFSETS[found[1]], cell.strip()) for cell in cells]


def _iso(cell: str) -> datetime.datetime | None:
    if not cell[:4].isdigit() or (cell.isdigit() and len(cell) != 14):
        return None
    try:
        return datetime.datetime.fromisoformat(cell.replace("/", "-"))
    except ValueError:
        return None


def _microseconds(stamp: datetime.datetime) -> int:
    zoned = stamp if stamp.tzinfo else stamp.replace(tzinfo=datetime.UTC)
    epoch = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
    return (zoned - epoch) // datetime.timedelta(microseconds=1)


def _split(cell: str) -> tuple[str, str]:
    """Return date and clock of a cell; the clock may be missing, and so may the date."""
    compact = re.fullmatch(r"(\d{4})(\d\d)(\d\d)[T ]?(\d\d)(\d\d)(\d\d)?(\.\d+)?", cell)
    if compact:
        y, m, d, hours, minutes, seconds, rest = compact.groups()
        return f"{y}-{m}-{d}", f"{hours}:{minutes}:{seconds or '00'}{rest or ''}"
    for mark in (" ", "T", ","):
        date, found, clock = cell.partition(mark)
        if found and _DATE.fullmatch(date):
            return date, clock.strip(" ,")
    return (cell, "0:00") if _DATE.fullmatch(cell) else ("", cell)


def _clock(text: str) -> float | None:
    """Return seconds since midnight; None for anything else."""
    found = _CLOCK.fullmatch(text)
    if found is None:
        return None
    hours, minutes, seconds = int(found[1]), int(found[2]), int(found[3] or 0)
    if found[5]:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + (12 if found[5] in "pP" else 0)
    if hours > 24 or minutes > 59 or seconds > 60:
        return None
    return 3600.0 * hours + 60.0 * minutes + seconds + float(f"0.{found[4] or 0}")


def _parts(date: str) -> tuple[int, str, int, int] | None:
    """Return year, ``?`` when day and month cannot be told apart by form, and the two.

    The two are day and month where that is known, else as they stand.
    """
    if not date:
        return 1970, "", 1, 1
    found = _DATE.fullmatch(date)
    if found is None:
        return None
    a, mark, b, c = found.groups()
    if len(a) > 2:
        return (int(a), "", int(c), int(b)) if b.isdigit() else None
    year = int(c) + (0 if len(c) > 2 else 2000 if int(c) < 70 else 1900)
    if not b.isdigit():
        folded = b.casefold()
        month = _MONTHS.get(folded[:4]) or _MONTHS.get(folded[:3])
        return None if month is None else (year, "", int(a), month)
    return year, "" if mark == "." else "?", int(a), int(b)


def _day(year: int, month: int, day: int) -> float:
    try:
        return float((datetime.date(year, month, day) - datetime.date(1970, 1, 1)).days)
    except ValueError:
        return np.nan


def _over_midnights(seconds: FloatArray) -> FloatArray:
    there = np.isfinite(seconds)
    falls = np.diff(seconds[there], prepend=seconds[there][:1]) < -0.5 * DAY
    unwrapped = seconds.copy()
    unwrapped[there] += DAY * np.cumsum(falls)
    return unwrapped


def _read(parts: list[tuple[int, str, int, int]], order: DateOrder) -> FloatArray | None:
    """Return the dates in one order, shape (D,); None when one of them is no date."""
    days = [
        _day(year, a, b) if mark == "?" and order is DateOrder.MONTH else _day(year, b, a)
        for year, mark, a, b in parts
    ]
    return None if np.isnan(days).any() else np.array(days)


def _steadier(
    found: dict[DateOrder, FloatArray], days: NDArray[np.int32], clocks: FloatArray
) -> dict[DateOrder, FloatArray]:
    """Return the one order in which time goes on evenly; all when that does not tell."""
    there = days >= 0
    longest = {}
    for order, read in found.items():
        steps = np.abs(np.diff(DAY * read[days[there]] + clocks[there]))
        longest[order] = float(steps.max()) if len(steps) else 0.0
    best = min(longest, key=lambda order: longest[order])
    worst = max(longest.values())
    return {best: found[best]} if 3.0 * longest[best] < worst else found
