"""What a user may say about exports; everything has a default."""

import dataclasses
import enum
from collections.abc import Mapping
from pathlib import Path

from stiction_ros.checks import of_kind
from stiction_ros.intake.sheets.stamps import DateOrder
from stiction_ros.intake.words import WORDS, by_word


class OpUnit(enum.StrEnum):
    """What OP is counted in; ``words.yaml`` has the ranges."""

    PERCENT = "percent"
    SHARE = "share"
    CURRENT = "ma"
    PSI = "psi"
    BAR = "bar"
    KILOPASCAL = "kpa"
    VOLT_10 = "0-10v"
    VOLT_1_5 = "1-5v"
    VOLT_2_10 = "2-10v"
    OTHER = "other"  # anything else; OP is taken as it is


LETTERS = {"op": "V", "pv": "PV", "sp": "PV", "stem": "V"}  # first letters of tags, if none

TO_PERCENT = {
    OpUnit(unit): (100.0 / (high - low), -100.0 * low / (high - low))
    for unit, (low, high, _) in WORDS["op_ranges"].items()
}
"""Factor and offset that make % of an OP."""

_OP_UNITS = {word: OpUnit(unit) for word, unit in by_word("op_units").items()}


class TimeUnit(enum.StrEnum):
    """What a time that is a number is counted in."""

    DAYS = "days"  # since the last day of 1899, as spreadsheets count, when they are that many
    HOURS = "h"
    MINUTES = "min"
    SECONDS = "s"
    MILLISECONDS = "ms"
    MICROSECONDS = "us"
    NANOSECONDS = "ns"


SECONDS = {TimeUnit(unit): float(size) for unit, size in WORDS["seconds"].items()}
_TIME_UNITS = {word: TimeUnit(unit) for word, unit in by_word("time_units").items()}


@dataclasses.dataclass(frozen=True)
class CsvColumns:
    """Which column is what; a tag to its column, None for the default names.

    In a file that :func:`stiction_ros.records.csv_writer.write_csv` wrote the default is what
    is written there, ``TAG.OP``, ``TAG.PV`` … included.

    Attributes:
        op: valve to column of its OP, default ``{"V1": "OP"}``; a column alone is that of V1, a
            list of them those of V1, V2, ….
        pv: output to column, default ``{"PV1": "PV"}``; the same for PV1, PV2, ….
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

    def __post_init__(self) -> None:
        for key, letter in LETTERS.items():
            given: object = getattr(self, key)
            if not isinstance(given, Mapping | None):
                alone = [given] if isinstance(given, str) else given
                fix = f"give a column, a list of them, or {{'{letter}1': 'COLUMN'}}"
                columns = enumerate(of_kind(alone, list, key, fix))
                object.__setattr__(self, key, {f"{letter}{k + 1}": name for k, name in columns})


@dataclasses.dataclass(frozen=True)
class IntakeOptions:
    """How exports are to be read."""

    columns: CsvColumns = CsvColumns()  # which column is what, for files of one loop
    namespace: str | None = None  # of the loop's topics, for bags that hold several loops
    tags: Path | None = None  # file of the tags of each loop; None finds them by their names
    strict: bool = False  # whether anything that had to be repaired is a problem
    op_unit: OpUnit | None = None  # of every OP; None takes it from the export
    time_unit: TimeUnit | None = None  # of times that are numbers; None takes it from the export
    dates: DateOrder | None = None  # which comes first in dates; None finds out
    # s, of signals that were reported when they changed, and of rows without a time; None finds it
    sample_time: float | None = None
    long: tuple[str, ...] | None = None  # columns of tag, time, value, one value a row; None finds
    automatic: tuple[str, ...] | None = None  # what MODE shows in automatic; None: the usual words


def known_op_unit(word: str) -> OpUnit | None:
    """Return the unit that a unit row or a bracket names; None for any other."""
    return _OP_UNITS.get(word.strip().casefold())


def known_time_unit(word: str) -> TimeUnit | None:
    """Return the unit of time that a unit row, a bracket or an end of a name is; None else."""
    return _TIME_UNITS.get(word.strip().casefold())
