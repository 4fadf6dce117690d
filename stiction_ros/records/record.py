"""One record of a loop: what everything that looks at data takes."""

import dataclasses
import enum
import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.signals.holds import stretches

IndexArray = np.ndarray[tuple[int], np.dtype[np.intp]]
QualityArray = np.ndarray[tuple[int], np.dtype[np.uint8]]


class Quality(enum.IntEnum):
    """What is known of one sample, as one byte of a record's mask."""

    GOOD = 0  # measured
    HELD = 1
    """Missing in the source; carried over from its neighbours, or interpolated between them."""
    BAD = 2  # not to be used; its values may be NaN
    MANUAL = 3  # measured, but the loop was not in automatic

    @property
    def word(self) -> str:
        """The name in files: ``good``, ``held``, ``bad`` or ``manual``."""
        return self.name.lower()


QUALITY_WORDS = {quality.word: quality for quality in Quality}  # word in files to quality
USABLE = (Quality.GOOD, Quality.HELD)  # what identification works on


class Gap(NamedTuple):
    """Where a record goes on after a gap, or where another run begins."""

    row: int  # first sample behind it
    start: float  # time of that sample on the record's own clock, s


class Segment(NamedTuple):
    """A stretch of samples without a gap."""

    first: int  # first, last: its samples, ``last`` not included
    last: int
    start: float  # time of the first on the record's own clock, s


@dataclasses.dataclass(frozen=True)
class Record:
    """Regularly sampled signals of one loop, arrays read-only.

    Inside a segment samples are ``sample_time`` apart; a plain record is one segment of good
    samples. Where time falls back from one segment to the next, another run begins.

    Attributes:
        name: where it came from, for messages and reports.
        sample_time: seconds between two samples.
        valves: tags of the m valves.
        outputs: tags of the p process variables.
        op: controller outputs, shape (N, m), %.
        pv: measured process variables, shape (N, p), engineering units.
        sp: set-points, shape (N, p), or None when not recorded.
        stem: true stem positions, shape (N, m), %, or None when not known.
        start: seconds of the first sample on the record's own clock.
        notes: what was repaired or ignored while reading, one sentence each.
        mask: :class:`Quality` of each sample, shape (N,); None when all are good.
        gaps: where it goes on after a gap, in the order of the samples.

    Raises:
        InputError: shapes that do not fit together, a value that is not finite at a sample
            that is not bad, an unknown quality, gaps out of order.

    Examples:
        >>> import numpy as np
        >>> from stiction_ros import Record
        >>> op, pv = np.full((4, 1), 50.0), np.ones((4, 1))
        >>> record = Record("FIC101", 2.0, ("V1",), ("PV1",), op, pv)
        >>> len(record), record.time.tolist()
        (4, [0.0, 2.0, 4.0, 6.0])
    """

    name: str
    sample_time: float
    valves: tuple[str, ...]
    outputs: tuple[str, ...]
    op: FloatArray
    pv: FloatArray
    sp: FloatArray | None = None
    stem: FloatArray | None = None
    start: float = 0.0
    notes: tuple[str, ...] = ()
    mask: QualityArray | None = None
    gaps: tuple[Gap, ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sample_time) and self.sample_time > 0):
            raise InputError(f"sample time {self.sample_time} is not positive", where=self.name)
        count = len(self.op)
        self._check_mask(count)
        rows = [0, *(gap.row for gap in self.gaps), count]
        if self.gaps and not all(before < after for before, after in itertools.pairwise(rows)):
            raise InputError(f"gaps at samples {rows[1:-1]} of {count}", where=self.name)
        bad = None if self.mask is None else self.mask == Quality.BAD
        for key, given in self.signals.items():
            values, wanted = np.array(given, dtype=float), (count, len(self.tags(key)))
            if values.shape != wanted:
                said = f"{key} has shape {values.shape}, not {wanted}"
                raise InputError(said, where=self.name, fix="Record.from_arrays takes vectors, too")
            if not np.isfinite(values).all():
                wrong = ~np.isfinite(values).all(axis=1)
                wrong &= True if bad is None else ~bad
                if wrong.any():
                    row = int(np.flatnonzero(wrong)[0])
                    raise InputError(f"{key} is not finite at sample {row}", where=self.name)
            values.flags.writeable = False
            object.__setattr__(self, key, values)

    @classmethod
    def from_arrays(
        cls,
        time: Any,
        op: Any,
        pv: Any,
        sp: Any = None,
        *,
        stem: Any = None,
        valves: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        op_unit: str | None = None,
        name: str = "record",
    ) -> "Record":
        """Return the record of arrays, checked and mended as a file is; of gaps the longest part.

        Args:
            time: of each sample, shape (N,), in s or as dates; or one number, the sample time in s.
            op: controller outputs, shape (N,) or (N, m), %.
            pv: process variables, shape (N,) or (N, p), engineering units.
            sp: set-points, shape of ``pv``, or None.
            stem: measured stem positions, shape of ``op``, %, or None.
            valves: tags of the m valves, V1, V2, … by default.
            outputs: tags of the p process variables, PV1, PV2, … by default.
            op_unit: of OP where it is not in %, such as ``share``, ``ma`` or ``0-10v``.
            name: for messages and reports.

        Raises:
            InputError: shapes that do not fit together, times that cannot be made regular, no
                good samples, or an OP that may be in another unit than %.

        Examples:
            >>> import numpy as np
            >>> from stiction_ros import Record
            >>> op, pv = np.array([50.0, 51.0, 53.0, 52.0]), np.array([7.0, 7.0, 7.1, 7.3])
            >>> record = Record.from_arrays([0.0, 0.5, 1.0, 1.5], op, pv)
            >>> record.sample_time, record.op.shape
            (0.5, (4, 1))
        """
        from stiction_ros.intake.arrays import record_from_arrays  # stands above, and loads slowly

        signals = {"op": op, "pv": pv, "sp": sp, "stem": stem}
        return record_from_arrays(time, signals, {"V": valves, "PV": outputs}, name, op_unit)

    @classmethod
    def from_dataframe(
        cls,
        frame: Any,
        op: str | list[str] | Mapping[str, str],
        pv: str | list[str] | Mapping[str, str],
        sp: str | list[str] | Mapping[str, str] | None = None,
        time: Any = None,
        *,
        stem: str | list[str] | Mapping[str, str] | None = None,
        name: str = "record",
        **reading: Any,
    ) -> "Record":
        """Return the record of some columns of a table, read as those of a file are.

        A column with the mode of the controller, or with qualities, counts as in a file.

        Args:
            frame: a DataFrame of pandas or Polars, or a mapping of columns.
            op: column of OP; a list of them for the valves V1, V2, …; or valve to column.
            pv: the same of PV, for the outputs PV1, PV2, …; or output to column.
            sp: the same of the set-points of the same outputs, or None.
            time: column of the times, or the times themselves, shape (N,), in s or as dates; None
                takes an index of dates, durations or decimal seconds, or a column such as ``time``.
            stem: as ``op``, of measured stem positions, %, or None.
            name: for messages and reports.
            reading: what the table does not tell: ``sample_time`` in s where it holds no times;
                ``op_unit`` as :meth:`from_arrays`; ``time_unit`` of times that are numbers, such
                as ``ms``; ``dates``, ``dmy`` or ``mdy``, of dates that are texts; ``automatic``,
                what the mode shows in automatic.

        Raises:
            InputError: no such column, times that cannot be made regular, no good samples.

        Examples:
            >>> from stiction_ros import Record
            >>> frame = {"t": [0, 1, 2], "valve": [50.0, 51.0, 53.0], "flow": [7.0, 7.0, 7.1]}
            >>> record = Record.from_dataframe(frame, op="valve", pv={"FI1": "flow"}, time="t")
            >>> record.outputs, len(record)
            (('FI1',), 3)
        """
        from stiction_ros.intake.arrays import record_from_frame  # stands above, and loads slowly

        columns = {"op": op, "pv": pv, "sp": sp, "stem": stem}
        return record_from_frame(frame, columns, time, name, reading)

    def _check_mask(self, count: int) -> None:
        if self.mask is None:
            return
        given = np.asarray(self.mask)
        if given.shape != (count,) or not np.isin(given, list(Quality)).all():
            raise InputError(
                f"mask of shape {given.shape} is no quality for each of {count} samples",
                where=self.name,
            )
        mask = given.astype(np.uint8)
        mask.flags.writeable = False
        object.__setattr__(self, "mask", mask if mask.any() else None)

    def __repr__(self) -> str:
        signals = [f"OP of {', '.join(self.valves)}", f"PV of {', '.join(self.outputs)}"]
        signals += list(self.signals)[2:]
        cut = f" in {len(self.gaps) + 1} segments" if self.gaps else ""
        size = f"{len(self)} samples of {self.sample_time:g} s{cut}"
        return f"<Record {self.name}: {size}; {', '.join(signals)}>"

    def __len__(self) -> int:
        return len(self.op)

    @property
    def signals(self) -> dict[str, FloatArray]:
        """The signals that are known, by the names of their attributes."""
        every = {"op": self.op, "pv": self.pv, "sp": self.sp, "stem": self.stem}
        return {key: values for key, values in every.items() if values is not None}

    def tags(self, key: str) -> tuple[str, ...]:
        """Return the tags of the columns of a signal."""
        return self.valves if key in ("op", "stem") else self.outputs

    @property
    def time(self) -> FloatArray:
        """Seconds since the first sample on the record's own clock, shape (N,)."""
        time = np.arange(len(self), dtype=np.float64) * self.sample_time
        for first, last, start in self.segments[1:]:
            time[first:last] += (start - self.start) - time[first]
        return time

    @property
    def quality(self) -> QualityArray:
        """:class:`Quality` of each sample, shape (N,), read-only."""
        if self.mask is not None:
            return self.mask
        return np.broadcast_to(np.uint8(Quality.GOOD), (len(self),))

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Which samples were measured, neither carried over nor drawn in, shape (N,)."""
        return np.asarray(self.quality != Quality.HELD)

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Stretches without a gap in time, in the order of the samples."""
        begins = (Gap(0, self.start), *self.gaps, Gap(len(self), 0.0))
        return tuple(Segment(a.row, b.row, a.start) for a, b in itertools.pairwise(begins))

    def part(self, first: int, last: int) -> "Record":
        """Return samples ``first`` up to, not including, ``last``."""
        rows = slice(first, last)
        start, gaps = self.start + first * self.sample_time, self.gaps
        if gaps:
            last = min(last, len(self))
            inside = next((s for s in self.segments if s.first <= first < s.last), self.segments[0])
            start = inside.start + (first - inside.first) * self.sample_time
            gaps = tuple(Gap(g.row - first, g.start) for g in gaps if first < g.row < last)
        cut: dict[str, Any] = {key: values[rows] for key, values in self.signals.items()}
        mask = None if self.mask is None else self.mask[rows]
        return dataclasses.replace(self, start=start, mask=mask, gaps=gaps, **cut)

    def usable_rows(self, wanted: Iterable[Quality] = USABLE) -> list[tuple[int, int]]:
        """Return the longest stretches of samples of ``wanted`` qualities without a gap.

        Each is its first sample and the one behind its last.
        """
        if self.mask is None:
            return [(s.first, s.last) for s in self.segments if s.last > s.first]
        there = np.isin(self.mask, list(wanted))
        begins, ends = stretches(there, [gap.row for gap in self.gaps])
        return list(zip(begins.tolist(), ends.tolist(), strict=True))

    def good_parts(self) -> "tuple[Record, ...]":
        """Return the stretches without a gap and without bad or manual samples."""
        stretches = self.usable_rows()
        if stretches == [(0, len(self))]:
            return (self,)
        return tuple(self.part(first, last) for first, last in stretches)

    def filled(self) -> "Record":
        """Return the record as one segment; in its gaps stand bad samples of NaN.

        A gap longer than the record itself is made as long as the record, and another run is
        put behind the one before, one bad sample away.
        """
        if not self.gaps:
            return self
        rows = self.filled_rows()
        mask = np.full(int(rows[-1]) + 1, Quality.BAD, dtype=np.uint8)
        mask[rows] = self.quality
        spread: dict[str, Any] = {}
        for key, values in self.signals.items():
            spread[key] = np.full((len(mask), values.shape[1]), np.nan)
            spread[key][rows] = values
        return dataclasses.replace(self, mask=mask, gaps=(), **spread)

    def filled_rows(self) -> IndexArray:
        """Return for each sample its row in :meth:`filled`, shape (N,)."""
        rows = np.arange(len(self))
        for before, after in itertools.pairwise(self.segments):
            end = before.start + (before.last - before.first) * self.sample_time
            missing = round((after.start - end) / self.sample_time)  # below 0 when time falls
            rows[after.first :] += min(max(missing, 1), len(self))
        return rows
