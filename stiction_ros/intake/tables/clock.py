"""Times of a table in seconds: which column, which unit, and when to ask."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import SECONDS, IntakeOptions, TimeUnit, known_time_unit
from stiction_ros.intake.sheets.names import OR_ROW, TIME_NAMES
from stiction_ros.intake.sheets.sheet import Sheet
from stiction_ros.intake.sheets.stamps import Times, is_stamp
from stiction_ros.intake.tables.block import Clock

EPOCHS = {
    TimeUnit.MILLISECONDS: (3e11, 4e12),
    TimeUnit.MICROSECONDS: (3e14, 4e15),
    TimeUnit.NANOSECONDS: (3e17, 4e18),
}
"""Numbers that are dates of 1980 to 2096 in a unit, and nothing that could be meant in s."""

SPREADSHEET = (25569.0, 73050.0)
"""Days since the last of 1899 in which spreadsheets count 1970 to 2099."""

LONG = 500.0
"""Steps from which a number that is no multiple of a minute is perhaps in milliseconds, s."""

DAY_LONG = 14400.0
"""Steps from which any number is perhaps in milliseconds, s: nobody keeps a loop each 4 h."""

SHORT = 0.05
"""Step, as a number, below which times as large as a spreadsheet's days may be such days."""


class TimeColumn(NamedTuple):
    """Where the times stand.

    Attributes:
        place: of the column.
        beside: column of the time of day, when ``place`` has the date alone.
    """

    place: int
    beside: int | None = None


ROWS_APART = TimeColumn(-1)
"""That of a table whose rows are a sample time apart, without times."""


def time_column(sheet: Sheet, name: str | None) -> TimeColumn:
    """Return the column of times: the one named, or the first with a usual name.

    Raises:
        InputError: there is none.
    """
    if name is not None:
        return TimeColumn(sheet.column(name, "--time COLUMN"))
    for date in ("date", "datum"):
        for clock in ("time", "zeit", "uhrzeit"):
            pair = sheet.find(date), sheet.find(clock)
            if pair[0] is not None and pair[1] is not None:
                return TimeColumn(pair[0], pair[1])
    for usual in TIME_NAMES:
        index = sheet.find(usual)
        if index is not None:
            return TimeColumn(index)
    for index, header in enumerate(sheet.layout.header):
        stem, _, unit = header.rpartition("_")
        if stem.casefold() in TIME_NAMES and known_time_unit(unit) is not None:
            return TimeColumn(index)
    for index, cells in enumerate(next((piece.columns for piece in sheet.pieces(1)), ())):
        dated = isinstance(cells, np.ndarray) and cells.dtype.kind == "M"
        if len(cells) and (dated or is_stamp(str(cells[0]))):
            return TimeColumn(index)
    return TimeColumn(sheet.column("t", "--time COLUMN"))


def in_seconds(
    times: Times, sheet: Sheet, index: int, options: IntakeOptions
) -> tuple[FloatArray, Clock, str]:
    """Return times in seconds since the first, their clock, and a note on the unit.

    Args:
        times: as read.
        sheet: that they stand in.
        index: of their column.
        options: a unit that was given.

    Raises:
        InputError: numbers of which the unit cannot be told.
    """
    clock = Clock(times.start, times.dated, times.zoned, times.zone, times.daily)
    if times.dated or times.daily:
        return times.seconds, clock, ""
    name, said = sheet.layout.given[index], sheet.layout.units[index]
    unit = options.time_unit or (TimeUnit.SECONDS if options.as_given else known_time_unit(said))
    if unit is None:
        unit = known_time_unit(re.split(r"[_ ]", sheet.layout.header[index])[-1])
        unit = None if sheet.layout.header[index].casefold() in TIME_NAMES else unit
    if unit is not None:
        return _scaled(times, unit, "" if unit is TimeUnit.SECONDS else f"{name} is in {unit}")
    for unit, (low, high) in EPOCHS.items():
        if low <= times.start <= high:
            return _scaled(times, unit, f"{name} is taken as {unit} since 1970")
    steps = np.diff(times.seconds[np.isfinite(times.seconds)])
    step = float(np.median(steps)) if len(steps) else 1.0
    if SPREADSHEET[0] <= times.start <= SPREADSHEET[1] and 0.0 < step < SHORT:
        return _scaled(times, TimeUnit.DAYS, f"{name} is taken as days of a spreadsheet")
    rounded = abs(step - 100.0 * round(step / 100.0)) < 1e-6 * step and step % 60.0 > 1e-6
    if (step >= LONG and rounded) or step >= DAY_LONG:
        raise InputError(
            f"samples are {step:g} apart in {name}, which may be milliseconds or seconds",
            where=str(sheet.path),
            fix=f"say which with --time-unit ms or --time-unit s {OR_ROW}",
        )
    dated = 3e8 <= times.start <= 4e9
    return times.seconds, clock._replace(dated=dated, zoned=dated), ""


def _scaled(times: Times, unit: TimeUnit, note: str) -> tuple[FloatArray, Clock, str]:
    factor, start = SECONDS[unit], times.start
    if unit is TimeUnit.DAYS and SPREADSHEET[0] <= start <= SPREADSHEET[1]:
        start -= SPREADSHEET[0]
    seconds = times.seconds * factor
    if unit is TimeUnit.DAYS:
        seconds = np.round(seconds, 3)  # a day's fraction is good for a tenth of a millisecond
    start *= factor
    dated = 3e8 <= start <= 4e9
    return seconds, Clock(start, dated, dated and unit is not TimeUnit.DAYS), note
