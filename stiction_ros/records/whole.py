"""All samples that a source holds of a loop, and the records that they make."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.record import QualityArray, Record
from stiction_ros.records.regular import HOLE, Part, regular_part, sample_time, split_at_gaps


@dataclasses.dataclass(frozen=True)
class Whole:
    """Samples of a loop on one clock, as they were given."""

    name: str  # of its records
    where: str  # file or bag, for errors
    place: Callable[[int], str]  # names a row for errors, ``place(3)`` → ``line 5``
    valves: tuple[str, ...]  # valves, outputs: tags
    outputs: tuple[str, ...]
    time: FloatArray  # increasing, shape (rows,), s since the first
    start: float  # time of the first on the source's own clock, s
    op: FloatArray  # op, stem: shape (rows, m); stem None when not known
    pv: FloatArray  # pv, sp: shape (rows, p); sp None when not known
    sp: FloatArray | None
    stem: FloatArray | None
    mask: QualityArray | None = None  # quality of each row, shape (rows,); None when all are good
    cut_holes: bool = False  # whether a stretch with too many holes is cut at them, not refused

    def records(self, notes: Sequence[str] = ()) -> tuple[Record, ...]:
        """Return one record for each stretch without a gap, with ``notes`` before its own.

        A step of more than 5.5 usual ones is a gap. Each row is a sample, also
        where its stamp is slightly off; short holes are held, and the mask says where.

        Raises:
            InputError: fewer than two rows, or samples that are irregular.
        """
        if len(self.time) < 2 or (self.time[1:] <= self.time[:-1]).any():
            sample_time(self.time, self.where, self.place)  # tells which row
        stretches = [edge for edge in split_at_gaps(self.time) if edge[1] - edge[0] > 1]
        parts = [part for edge in stretches for part in self._parts(*edge)]
        rows = sum(last - first for first, last in stretches)
        said = list(notes)
        for count, between in (
            (len(self.time) - rows, "gaps"),
            (rows - sum(part.last - part.first for part in parts), "holes"),
        ):
            if count:
                said.append(f"{count} rows alone between two {between} left out")
        if len(parts) > 1:
            said.append(f"split at {len(parts) - 1} gap{'s' * (len(parts) > 2)}")
        return self._regular(parts, said)

    def _parts(self, first: int, last: int) -> list[Part]:
        """Return the stretch as it is, or its pieces between holes."""
        part = regular_part(self.time, first, last)
        hole = HOLE * float(np.median(np.diff(self.time)))
        if not (self.cut_holes and (np.diff(part.time) > hole).any()):
            return [part]
        cuts = np.flatnonzero(np.diff(self.time[first:last]) > hole) + first + 1
        edges = itertools.pairwise([first, *cuts.tolist(), last])
        return [regular_part(self.time, a, b) for a, b in edges if b - a > 1]

    def _regular(self, parts: Sequence[Part], notes: list[str]) -> tuple[Record, ...]:
        """Return the parts as records; those that are irregular are left out if others are not."""
        found: list[Record] = []
        refused: list[InputError] = []
        for part in parts:
            try:
                found.append(self._record(part, notes))
            except InputError as error:
                refused.append(error)
        if refused and (not found or not self.cut_holes):
            raise refused[0]
        if not found:
            sample_time(self.time, self.where, self.place)  # tells where it is irregular
        if refused:
            notes.append(f"{len(refused)} irregular parts left out: {refused[0].what}")
            found = [dataclasses.replace(r, notes=(*r.notes, notes[-1])) for r in found]
        return tuple(found)

    def _record(self, part: Part, notes: Sequence[str]) -> Record:
        step, more = sample_time(part.time, self.where, lambda row: self.place(part.first + row))
        return Record(
            name=self.name,
            sample_time=step,
            valves=self.valves,
            outputs=self.outputs,
            op=part.held(self.op),
            pv=part.interpolated(self.pv),
            sp=None if self.sp is None else part.held(self.sp),
            stem=None if self.stem is None else part.interpolated(self.stem),
            start=self.start + float(part.time[0]),
            notes=(*notes, *([part.note] if part.note else []), *more),
            mask=part.quality(self.mask),
        )
