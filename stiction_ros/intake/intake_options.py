"""What a user may say about exports; everything has a default."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Mapping
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.intake.sheets.stamps import DateOrder
from stiction_ros.intake.words import by_word


class OpUnit(enum.StrEnum):
    """What OP is counted in."""

    PERCENT = "percent"
    SHARE = "share"
    """0 to 1."""
    CURRENT = "ma"
    """4 to 20 mA."""
    PSI = "psi"
    """3 to 15 psi, see IEC 60382."""
    BAR = "bar"
    """0.2 to 1 bar, see IEC 60382."""
    KILOPASCAL = "kpa"
    """20 to 100 kPa, see IEC 60382."""
    VOLT_10 = "0-10v"
    VOLT_1_5 = "1-5v"
    VOLT_2_10 = "2-10v"
    OTHER = "other"
    """Anything else; OP is taken as it is."""


TO_PERCENT = {
    OpUnit.PERCENT: (1.0, 0.0),
    OpUnit.SHARE: (100.0, 0.0),
    OpUnit.CURRENT: (6.25, -25.0),
    OpUnit.PSI: (100.0 / 12.0, -25.0),
    OpUnit.BAR: (125.0, -25.0),
    OpUnit.KILOPASCAL: (1.25, -25.0),
    OpUnit.VOLT_10: (10.0, 0.0),
    OpUnit.VOLT_1_5: (25.0, -25.0),
    OpUnit.VOLT_2_10: (12.5, -25.0),
    OpUnit.OTHER: (1.0, 0.0),
}
"""Factor and offset that make % of an OP."""

_OP_UNITS = {word: OpUnit(unit) for word, unit in by_word("op_units").items()}


class TimeUnit(enum.StrEnum):
    """What a time that is a number is counted in."""

    DAYS = "days"
    """Since the last day of 1899, as spreadsheets count, when they are that many."""
    HOURS = "h"
    MINUTES = "min"
    SECONDS = "s"
    MILLISECONDS = "ms"
    MICROSECONDS = "us"
    NANOSECONDS = "ns"


SECONDS = {
    TimeUnit.DAYS: 86400.0,
    TimeUnit.HOURS: 3600.0,
    TimeUnit.MINUTES: 60.0,
    TimeUnit.SECONDS: 1.0,
    TimeUnit.MILLISECONDS: 1e-3,
    TimeUnit.MICROSECONDS: 1e-6,
    TimeUnit.NANOSECONDS: 1e-9,
}

_TIME_UNITS = {word: TimeUnit(unit) for word, unit in by_word("time_units").items()}


@dataclasses.dataclass(frozen=True)
class CsvColumns:
    """Which column is what; a tag to its column, None for the default names.

    In a file that :func:`stiction_ros.records.csv_writer.write_csv` wrote the default is what
    is written there, ``TAG.OP``, ``TAG.PV`` … included.

    Attributes:
        op: valve to column of its OP, default ``{"V1": "OP"}``.
        pv: output to column, default ``{"PV1": "PV"}``.
        sp: output to column of its set-point, default ``SP`` when it is there.
        stem: valve to column of its measured stem, default ``STEM`` when it is there.
        time: column of the time, default ``t``, then ``time`` or ``timestamp`` and the like.

    Examples:
        >>> from stiction_ros import CsvColumns
        >>> columns = CsvColumns(op={"V1": "FIC101.OP"}, pv={"PV1": "FIC101.PV"}, time="stamp")
        >>> columns.sp is None  # taken from the column SP where there is one
        True
    """

    op: Mapping[str, str] | None = None
    pv: Mapping[str, str] | None = None
    sp: Mapping[str, str] | None = None
    stem: Mapping[str, str] | None = None
    time: str | None = None


@dataclasses.dataclass(frozen=True)
class IntakeOptions:
    """How exports are to be read.

    Attributes:
        columns: which column is what, for files of one loop.
        namespace: of the loop's topics, for bags that hold several loops.
        tags: file that lists which tags make up which loop; None finds them by their names.
        strict: whether anything that had to be repaired is a problem.
        op_unit: of every OP; None takes it from the export.
        time_unit: of times that are numbers; None takes it from the export.
        dates: which comes first in dates; None finds out.
        sample_time: s, of signals that were reported when they changed, and of rows without a
            time; None finds it.
        long: columns of tag, time and value of tables with one value a row; None finds them.
        automatic: what MODE shows in automatic; None knows the usual words.
        as_given: whether signals are taken as they are: OP and numbers as times are not brought
            to another unit, and nothing is asked.
    """

    columns: CsvColumns = CsvColumns()
    namespace: str | None = None
    tags: Path | None = None
    strict: bool = False
    op_unit: OpUnit | None = None
    time_unit: TimeUnit | None = None
    dates: DateOrder | None = None
    sample_time: float | None = None
    long: tuple[str, ...] | None = None
    automatic: tuple[str, ...] | None = None
    as_given: bool = False


def op_unit(word: str, where: str | Path) -> OpUnit:
    """Return the unit of an OP by its word.

    Raises:
        InputError: another word.
    """
    found = known_op_unit(word)
    if found is None:
        raise InputError(
            f"unit {word!r} of OP is unknown", where=str(where), fix=f"use {', '.join(OpUnit)}"
        )
    return found


def known_op_unit(word: str) -> OpUnit | None:
    """Return the unit that a unit row or a bracket names; None for any other."""
    return _OP_UNITS.get(word.strip().casefold())


def known_time_unit(word: str) -> TimeUnit | None:
    """Return the unit of time that a unit row, a bracket or an end of a name is; None else."""
    return _TIME_UNITS.get(word.strip().casefold())
