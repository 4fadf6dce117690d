"""What a survey says about one loop, and what it is told."""

import dataclasses
import enum
from collections.abc import Mapping
from typing import Any

from stiction_ros.identification.identification_options import IdentificationOptions

Interval = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class SurveyOptions:
    """What a worker is told beside the loop."""

    identification: IdentificationOptions = IdentificationOptions()  # of every identification
    gain: bool = True  # whether what would help is simulated for the valves that are found
    pages: bool = True  # whether a page is written for each loop
    units: tuple[tuple[str, str], ...] = ()  # engineering unit of PV by loop, for the pages
    read_by: str = ""  # how the exports are read; other ways give other records

    def mark(self) -> str:
        """Return what tells options apart whose entries differ."""
        return repr((self.identification, self.gain, self.read_by))


class Status(enum.StrEnum):
    """How far a loop came.

    ``OK``: it was judged. ``SKIPPED``: it was read and there is nothing to judge, as in manual.
    ``FAILED``: it could not be read, or judging it broke off.
    """

    OK = "ok"
    SKIPPED = "skipped"
    FAILED = "failed"


@dataclasses.dataclass(frozen=True)
class Cycling:
    """How PV − SP oscillates: period in s, amplitude in engineering units."""

    period: float | None
    regularity: float
    amplitude: float


@dataclasses.dataclass(frozen=True)
class Entry:
    """One row of the list; None where there is nothing to say."""

    name: str  # tag of the loop
    files: tuple[str, ...]  # that it was read from
    status: Status  # status, reason: how far it came, and why no further, empty when judged
    reason: str = ""
    samples: int | None = None  # of all parts
    sample_time: float | None = None  # s
    auto_share: float | None = None  # share of the samples in automatic
    saturated_share: float | None = None  # share of those with OP at rest at an end of its range
    oscillation: Cycling | None = None  # of PV − SP
    verdict: str | None = None  # of the valve
    cause: str | None = None  # of the oscillation
    f_s: float | None = None  # f_s, f_d: frictions with their intervals, in the unit of OP
    f_s_interval: Interval | None = None
    f_d: float | None = None
    f_d_interval: Interval | None = None
    band_share: float | None = None  # f_S + f_D over the width of OP's movement
    travel_per_hour: float | None = None  # travel_per_hour, reversals_per_hour: of the stem
    reversals_per_hour: float | None = None
    gain: Mapping[str, Any] | None = None  # measures now and by option, as of ``stiction gain``
    probability: float | None = None  # of friction, 0 to 1; None where a method does not tell
    # figures behind the verdict by name, as in ``identify --json``
    evidence: Mapping[str, float] = dataclasses.field(default_factory=dict)
    # what the first round of a valve test would take where the valve is undecided: ``duration``, s,
    # and ``pv_move``, how far PV is expected to move
    test: Mapping[str, float | None] | None = None
    cost_per_hour: float | None = None  # what the cycle costs, where a cost was given
    rank: int | None = None  # place in the list, from 1
    group: int | None = None  # number of the group of loops that cycle together, from 1
    report: str | None = None  # page of the loop, relative to the list
    op_unit: str = "%"  # what OP, friction and travel are in
    notes: tuple[str, ...] = ()  # what was repaired, left out, found; one sentence each
    beats: tuple[float, ...] = ()  # when cycles begin, s on the clock of the record

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of ``survey --json``."""
        row = dataclasses.asdict(self)
        del row["beats"]
        return row

    @classmethod
    def from_line(cls, line: Mapping[str, Any]) -> "Entry":
        """Return the entry of a mapping of all its fields, also through JSON."""
        row = dict(line)
        cycle = row["oscillation"]
        row["oscillation"] = None if cycle is None else Cycling(**cycle)
        row["status"] = Status(row["status"])
        for key in ("files", "f_s_interval", "f_d_interval", "notes", "beats"):
            row[key] = None if row[key] is None else tuple(row[key])
        return cls(**row)

    @property
    def found(self) -> bool:
        """Whether the valve was found to stick or to have backlash."""
        return self.verdict in ("sticky", "backlash")
