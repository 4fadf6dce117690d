"""A window of four cycles: where an engineer looks first."""

from __future__ import annotations

import dataclasses

from stiction_ros.identification import Identification
from stiction_ros.identification.answer.words import cause_of
from stiction_ros.identification.result.cause import CauseKind
from stiction_ros.records.record import Record

CYCLES = 4

UNCYCLED = 240  # samples of the window where there is no cycle


@dataclasses.dataclass(frozen=True)
class Window:
    """The part of a record that is shown closely."""

    valve: int  # valve, output: indices
    output: int
    first: int  # first, last: its first row and the one behind its last
    last: int
    period: float | None  # of the cycle, s; None where there is none

    @classmethod
    def of(cls, record: Record, found: Identification) -> Window:
        """Return four cycles from the middle of the longest good part.

        The valve is the one with the widest band, the output the one that oscillates with it.
        """
        valve = max(range(len(found.valves)), key=lambda j: found.valves[j].band_share, default=0)
        cause = cause_of(found, valve) if found.valves else None
        outputs = [i for i, model in enumerate(found.outputs) if model.cause is cause]
        output = outputs[0] if cause is not None and outputs else min(valve, record.pv.shape[1] - 1)
        cycles = cause is not None and cause.kind is not CauseKind.NONE
        period = cause.period if cause is not None and cycles else None
        parts = record.usable_rows() or [(0, len(record))]
        begin, end = max(parts, key=lambda part: part[1] - part[0])
        wanted = UNCYCLED if period is None else round(CYCLES * period / record.sample_time) + 1
        wanted = min(wanted, end - begin)
        first = begin + (end - begin - wanted) // 2
        return cls(valve, output, first, first + wanted, period)

    @property
    def rows(self) -> slice:
        """Its rows."""
        return slice(self.first, self.last)

    def named(self, sample_time: float) -> str:
        """Return what is shown, in words."""
        if self.period is None:
            return f"{self.last - self.first} samples without a regular cycle"
        cycles = (self.last - self.first - 1) * sample_time / self.period
        return f"about {cycles:.2g} cycles of {self.period:.3g} s on average"
