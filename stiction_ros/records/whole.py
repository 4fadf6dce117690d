"""All samples that a source holds of a loop, and the records that they make.

What a sample lacks is held (OP, SP) or interpolated (PV, stem) for up to :data:`HELD` samples in
a row; more of them, and those at an end, are bad.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.record import Quality, QualityArray, Record
from stiction_ros.records.regular import HELD, HOLE, Part, regular_part, sample_time, split_at_gaps
from stiction_ros.signals.holds import stretches
from stiction_ros.texts import plural


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
    # ``op``, ``pv``, and ``sp`` and ``stem`` where known, shape (rows, tags); NaN where missing
    signals: Mapping[str, FloatArray]
    mask: QualityArray | None = None  # quality of each row, shape (rows,); None when all are good
    cut_holes: bool = False  # whether a stretch with too many holes is cut at them, not refused

    def records(self, notes: Sequence[str] = ()) -> tuple[Record, ...]:
        """Return one record for each stretch without a gap, with ``notes`` before its own.

        A step of more than 5.5 usual ones is a gap. Each row is a sample, also where its stamp is
        slightly off. Parts that are irregular are left out if others are not and holes are cut.

        Raises:
            InputError: fewer than two rows, or samples that are irregular.
        """
        if len(self.time) < 2 or (self.time[1:] <= self.time[:-1]).any():
            sample_time(self.time, self.where, self.place)  # tells which row
        edges = [edge for edge in split_at_gaps(self.time) if edge[1] - edge[0] > 1]
        parts = [part for edge in edges for part in self._parts(*edge)]
        rows = sum(last - first for first, last in edges)
        said = list(notes)
        for count, between in (
            (len(self.time) - rows, "gaps"),
            (rows - sum(part.last - part.first for part in parts), "holes"),
        ):
            if count:
                said.append(f"{count} rows alone between two {between} left out")
        if len(parts) > 1:
            said.append(f"split at {len(parts) - 1} gap{'s' * (len(parts) > 2)}")
        found: list[Record] = []
        refused: list[InputError] = []
        for part in parts:
            try:
                found.append(self._record(part))
            except InputError as error:
                refused.append(error)
        if refused and (not found or not self.cut_holes):
            raise refused[0]
        if not found:
            sample_time(self.time, self.where, self.place)  # tells where it is irregular
        if refused:
            said.append(f"{len(refused)} irregular parts left out: {refused[0].what}")
        return tuple(dataclasses.replace(r, notes=(*said, *r.notes)) for r in found)

    def _parts(self, first: int, last: int) -> list[Part]:
        """Return the stretch as it is, or its pieces between holes."""
        part = regular_part(self.time, first, last)
        hole = HOLE * float(np.median(np.diff(self.time)))
        if not (self.cut_holes and (np.diff(part.time) > hole).any()):
            return [part]
        cuts = np.flatnonzero(np.diff(self.time[first:last]) > hole) + first + 1
        edges = itertools.pairwise([first, *cuts.tolist(), last])
        return [regular_part(self.time, a, b) for a, b in edges if b - a > 1]

    def _record(self, part: Part) -> Record:
        """Return a part as a record; notes tell how its times were mended and what was missing."""
        step, more = sample_time(part.time, self.where, lambda row: self.place(part.first + row))
        rows = part.rows
        empty = np.diff(rows, prepend=-1) == 0  # times without a row
        mask = np.zeros(len(rows), dtype=np.uint8) if self.mask is None else self.mask[rows]
        given = mask == Quality.BAD
        held, far = np.zeros((2, len(rows)), dtype=np.bool_)
        signals = {}
        for key, values in self.signals.items():
            columns = []
            for column in np.where(empty, np.nan, values[rows].T):
                missing = ~np.isfinite(column)
                short = _short(missing, given)
                columns.append(np.where(short, carried(column, key in ("pv", "stem")), column))
                held |= short
                far |= missing & ~short & ~given
            signals[key] = np.column_stack(columns)
        mask[held & ~far & (mask == Quality.GOOD)] = Quality.HELD
        mask[far] = Quality.BAD
        said = f"held over at most {HELD} in a row (PV interpolated)"
        counts = {said: held & ~far, "bad, cut out": far}
        lacks = [
            f"{plural(int(n.sum()), 'sample')} {what}" for what, n in counts.items() if n.any()
        ]
        return Record(
            name=self.name,
            sample_time=step,
            valves=self.valves,
            outputs=self.outputs,
            op=signals["op"],
            pv=signals["pv"],
            sp=signals.get("sp"),
            stem=signals.get("stem"),
            start=self.start + float(part.time[0]),
            notes=tuple(filter(None, (part.note, *more, *lacks))),
            mask=mask,
        )


def _short(missing: NDArray[np.bool_], bad: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which missing values have measured ones near on both sides, shape (N,)."""
    short = missing & ~bad
    for first, last in zip(*stretches(missing | bad), strict=True):
        if not (first > 0 and last < len(missing) and last - first <= HELD):
            short[first:last] = False
    return short


def carried(values: FloatArray, between: bool) -> FloatArray:
    """Return values, shape (N,), that are held, or drawn ``between`` those that are there."""
    there, rows = np.flatnonzero(np.isfinite(values)), np.arange(len(values))
    if not len(there):
        return values
    if between:
        return np.interp(rows, there, values[there])
    return values[there[np.maximum(np.searchsorted(there, rows, side="right") - 1, 0)]]
