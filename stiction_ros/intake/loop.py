"""One loop of a plant, as it was found in exports."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from stiction_ros.intake.shown import Spread
from stiction_ros.records.parts import span
from stiction_ros.records.record import Record


@dataclasses.dataclass(frozen=True)
class Loop:
    """A named loop with its records, or the reason why there are none."""

    name: str  # of the loop: its tag, or the name of its file
    files: tuple[Path, ...]  # that it was read from
    # its records, one for each stretch without a gap, in their order; a sample's quality says what
    # was held, bad or in manual. Empty when there is a problem
    parts: tuple[Record, ...]
    notes: tuple[str, ...] = ()  # what was masked, held, cut, converted; the records bear the same
    problem: str | None = None  # why it cannot be read and what helps; None when it can be
    columns: Mapping[str, str] = dataclasses.field(default_factory=dict)  # of each signal, or tag
    op_unit: str = "%"  # what OP is in; OP of a share or a current has been brought to %
    # signal to the least, median and largest number of its column, in the column's own unit; of
    # bags OP in %
    spreads: Mapping[str, Spread] = dataclasses.field(default_factory=dict)
    modes: tuple[str, ...] = ()  # words of the mode, each with its count and what it is taken for

    @property
    def summary(self) -> str:
        """Samples, sample time, span and unit of OP in one sentence; or the problem."""
        if self.problem is not None:
            return self.problem
        samples = sum(map(len, self.parts))
        steps = sorted({f"{part.sample_time:.6g} s" for part in self.parts})
        parts = f" in {len(self.parts)} parts" if len(self.parts) > 1 else ""
        return (
            f"{samples} samples{parts}, one each {' or '.join(steps)}, {span(*self.parts)}, "
            f"OP in {self.op_unit}"
        )
