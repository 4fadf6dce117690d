"""Times of a table in seconds: which column, which unit, and when to ask."""

import itertools
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import SECONDS, IntakeOptions, TimeUnit, known_time_unit
from stiction_ros.intake.sheets.cells import Cells, is_number
from stiction_ros.intake.sheets.names import OR_ROW, TIME_NAMES, read_tag
from stiction_ros.intake.sheets.sheet import Sheet
from stiction_ros.intake.sheets.stamps import Clock, Times, is_stamp
from stiction_ros.records.parts import DATES

DATED = (DATES, 4e9)  # seconds since 1970 that are taken for dates: 1979 to 2096
SPREADSHEET = (25569.0, 73050.0)  # days since the last of 1899, for 1970 to 2099
LONG = 500.0  # s; longer steps that are no multiple of a minute may be milliseconds
DAY_LONG = 14400.0  # s; longer steps may be milliseconds: nobody keeps a loop each 4 h
SHORT = 0.05  # a number; shorter steps of large times may be days of a spreadsheet

_MIDNIGHT = re.compile(r"[T ]0?0:00(:00(\.0+)?)?$")


class TimeColumn(NamedTuple):
    """Where the times stand; ``beside`` is the time of day, when ``place`` has the date alone."""

    place: int
    beside: int | None = None

    def cells(self, columns: Sequence[Cells]) -> Cells:
        """Return the stamps of a piece of the table."""
        if self.beside is None:
            return columns[self.place]
        pairs = zip(columns[self.place], columns[self.beside], strict=True)
        return [f"{_MIDNIGHT.sub('', str(date))} {clock}".strip() for date, clock in pairs]


ROWS_APART = TimeColumn(-1)  # that of a table whose rows are a sample time apart, without times


def time_column(sheet: Sheet, name: str | None) -> TimeColumn:
    """Return the column of times: the one named, or the first with a usual name."""
    if name is not None:
        return TimeColumn(sheet.column(name, "--time COLUMN"))
    for date, clock in itertools.product(("date", "datum"), ("time", "zeit", "uhrzeit")):
        place, beside = sheet.find(date), sheet.find(clock)
        if place is not None and beside is not None:
            return TimeColumn(place, beside)
    for usual in TIME_NAMES:
        if (place := sheet.find(usual)) is not None:
            return TimeColumn(place)
    for index, header in enumerate(sheet.layout.header):
        stem, _, unit = header.rpartition("_")
        if stem.casefold() in TIME_NAMES and known_time_unit(unit) is not None:
            return TimeColumn(index)
    for index, cells in enumerate(next((columns for columns, _ in sheet.pieces(1)), ())):
        dated = isinstance(cells, np.ndarray) and cells.dtype.kind == "M"
        if len(cells) and (dated or is_stamp(str(cells[0]))):
            return TimeColumn(index)
    return TimeColumn(sheet.column("t", "--time COLUMN"))


def in_seconds(times: Times, sheet: Sheet, index: int, options: IntakeOptions) -> Times:
    """Return times as they were read, from column ``index``, in seconds; a note tells their unit.

    Raises:
        InputError: numbers of which the unit cannot be told.
    """
    start = times.clock.start
    if times.clock.dated or times.clock.daily:
        return times
    name, bare = sheet.layout.given[index], sheet.layout.header[index]
    unit = options.time_unit or known_time_unit(sheet.layout.units[index])
    if unit is None and bare.casefold() not in TIME_NAMES:
        unit = known_time_unit(re.split(r"[_ ]", bare)[-1])
    if unit is not None:
        return _scaled(times, unit, "" if unit is TimeUnit.SECONDS else f"{name} is in {unit}")
    for unit in (TimeUnit.MILLISECONDS, TimeUnit.MICROSECONDS, TimeUnit.NANOSECONDS):
        if DATED[0] <= start * SECONDS[unit] <= DATED[1]:
            return _scaled(times, unit, f"{name} is taken as {unit} since 1970")
    steps = np.diff(times.seconds[np.isfinite(times.seconds)])
    step = float(np.median(steps)) if len(steps) else 1.0
    if SPREADSHEET[0] <= start <= SPREADSHEET[1] and 0.0 < step < SHORT:
        return _scaled(times, TimeUnit.DAYS, f"{name} is taken as days of a spreadsheet")
    rounded = abs(step - 100.0 * round(step / 100.0)) < 1e-6 * step and step % 60.0 > 1e-6
    if (step >= LONG and rounded) or step >= DAY_LONG:
        raise InputError(
            f"samples are {step:g} apart in {name}, which may be milliseconds or seconds",
            fix=f"say which with --time-unit ms or --time-unit s {OR_ROW}",
        )
    return _scaled(times, TimeUnit.SECONDS, "")


def _scaled(times: Times, unit: TimeUnit, note: str) -> Times:
    start, seconds = times.clock.start, times.seconds * SECONDS[unit]
    if unit is TimeUnit.DAYS:
        seconds = np.round(seconds, 3)  # a day's fraction is good for a tenth of a millisecond
        start -= SPREADSHEET[0] * (SPREADSHEET[0] <= start <= SPREADSHEET[1])
    start *= SECONDS[unit]
    dated = DATED[0] <= start <= DATED[1]
    clock = Clock(start, dated, dated and unit is not TimeUnit.DAYS)
    return times._replace(seconds=seconds, clock=clock, note=note)


def kind_of(cells: Cells) -> str:
    """Return what most cells of a column are: stamp, number, text; empty when nothing is there."""
    if isinstance(cells, np.ndarray):
        return "stamp" if cells.dtype.kind == "M" else "number"
    counts = Counter(
        "stamp" if is_stamp(cell) else "number" if is_number(cell) else "text"
        for cell in cells[:: max(len(cells) // 100, 1)]
        if cell.strip()
    )
    return counts.most_common(1)[0][0] if counts else ""


def repeats(cells: Cells) -> bool:
    """Return whether each cell of a column is there twice on average."""
    return 2 * len(set(cells)) <= len(cells)


def is_clock(name: str, cells: Cells) -> bool:
    """Return whether a column holds stamps, or numbers under the name of a time."""
    if (told := read_tag(name)) is not None and not told.quality:
        return False
    kind = kind_of(cells)
    bare = re.sub(r"[\s._(#-]*\d*\)?$", "", name).casefold()
    return kind == "stamp" or (kind == "number" and bare in TIME_NAMES)
