"""What historians keep of signals, and the record that is left of a run."""

import dataclasses

import numpy as np

from stiction_ros.records.record import Gap, Quality, QualityArray, Record
from stiction_studies.field.circumstances import UNITS, Circumstances, Friction, Hole, Keeping, Unit
from stiction_studies.field.drawing import Made
from stiction_studies.field.kernels import FlagArray, FloatArray
from stiction_studies.field.simulation import Run

OP_STEPS = (0.1, 0.2, 0.25, 0.5, 1.0)
"""Resolutions of OP, %; of those, one below a quarter of the band, or a tenth of OP's range."""

IndexArray = np.ndarray[tuple[int], np.dtype[np.intp]]


def sampled(values: FloatArray, steps: int) -> FloatArray:
    """Return every ``steps``-th value."""
    return values[::steps]


def averaged(values: FloatArray, steps: int) -> FloatArray:
    """Return the means of blocks of ``steps`` values, each at the block's first."""
    count = len(values) // steps
    return np.asarray(values[: count * steps].reshape(count, steps).mean(axis=1))


def rounded(values: FloatArray, step: float) -> FloatArray:
    """Return values rounded to multiples of ``step``."""
    return np.round(values / step) * step


def excepted(values: FloatArray, deadband: float, longest: int) -> FloatArray:
    """Return values that are reported when they have moved by more than ``deadband``, and held.

    Args:
        values: shape (N,).
        deadband: same unit.
        longest: samples after which a value is reported anyway.
    """
    kept = values.copy()
    last, age = float(values[0]), 0
    for k in range(1, len(values)):
        age += 1
        if abs(float(values[k]) - last) > deadband or age >= longest:
            last, age = float(values[k]), 0
        kept[k] = last
    return kept


def swinging_door(values: FloatArray, deviation: float, longest: int) -> FloatArray:
    """Return values compressed by a swinging door and drawn again by straight lines.

    A point is kept where no line from the last one kept passes within ``deviation`` of all
    since; between points that are kept stands the line.

    Args:
        values: shape (N,).
        deviation: same unit.
        longest: samples that a line spans at most.

    References:
        E. H. Bristol: Swinging door trending: adaptive trend recording? ISA National
        Conference Proceedings 1990, 749-753.
    """
    points = [0]
    low, high = -np.inf, np.inf
    for k in range(1, len(values)):
        for _ in range(2):
            span = k - points[-1]
            rise = float(values[k] - values[points[-1]])
            low = max(low, (rise - deviation) / span)
            high = min(high, (rise + deviation) / span)
            if span == 1 or (low <= high and span <= longest):
                break
            points.append(k - 1)
            low, high = -np.inf, np.inf
    rows = [*points, len(values) - 1]
    return np.asarray(np.interp(np.arange(len(values)), rows, values[rows]))


@dataclasses.dataclass(frozen=True)
class Kept:
    """A record and where its rows come from.

    Attributes:
        record: what is left.
        rows: sample of the run for each row of the record, shape (N,).
        offset: of OP after the change of its unit.
    """

    record: Record
    rows: IndexArray
    offset: float

    def row_of(self, sample: int) -> int | None:
        """Return the row of the record at a sample of the run; None where it was cut out."""
        row = int(np.searchsorted(self.rows, sample))
        return row if row < len(self.rows) and self.rows[row] == sample else None


def archived(
    random: np.random.Generator, c: Circumstances, made: Made, out: Run, name: str
) -> Kept:
    """Return what the historian keeps of a run.

    Args:
        random: source of resolutions and holes.
        c: circumstances.
        made: the loop.
        out: its run, the time before the record included.
        name: of the record.
    """
    steps = made.loop.clock.sample
    take = averaged if c.keeping is Keeping.AVERAGED else sampled
    op, pv = (take(signal[made.warm :], steps) for signal in (out.op, out.pv))
    sp = sampled(made.signals.set_point[made.warm :], steps)
    manual = sampled(made.signals.manual[made.warm :].astype(np.float64), steps) > 0.0
    op, pv = _reported(random, c, made, op, pv, ~manual[: len(op)])
    factor, offset = UNITS[c.unit]
    if c.unit is Unit.CENTRED:
        offset = -float(op.mean())
    op = factor * op + offset
    mask = np.zeros(len(op), dtype=np.uint8)
    if c.manual_marked:
        mask[manual] = Quality.MANUAL
    rows = np.arange(len(op))
    gaps: tuple[Gap, ...] = ()
    sample_time = float(f"{steps * made.loop.clock.step:.9g}")
    if c.hole is Hole.ROWS:
        op, pv, sp, mask = _with_missing_rows(random, op, pv, sp, mask)
    elif c.hole is Hole.BAD:
        first = int(random.uniform(0.05, 0.3) * len(op))
        bad = slice(first, first + int(random.integers(1, 30)))
        pv = pv.copy()
        pv[bad], mask[bad] = np.nan, Quality.BAD
    elif c.hole is Hole.GAP:
        first = int(random.uniform(0.1, 0.3) * len(op))
        length = int(random.integers(6, 100))
        rows = np.delete(rows, slice(first, first + length))
        gaps = (Gap(first, float((first + length) * sample_time)),)
    record = Record(
        name=name,
        sample_time=sample_time,
        valves=("V1",),
        outputs=("PV1",),
        op=op[rows, None],
        pv=pv[rows, None],
        sp=sp[rows, None] if c.set_point_kept else None,
        mask=mask[rows],
        gaps=gaps,
    )
    return Kept(record, rows, offset)


def _reported(
    random: np.random.Generator,
    c: Circumstances,
    made: Made,
    op: FloatArray,
    pv: FloatArray,
    automatic: FlagArray,
) -> tuple[FloatArray, FloatArray]:
    """Return OP and PV after rounding, exception or compression, set by what they do in control."""
    op_range, pv_range = (
        max(float(np.subtract(*np.percentile(signal[automatic], [98.0, 2.0]))), 1e-6)
        for signal in (op, pv)
    )
    if c.keeping in (Keeping.OP_ROUNDED, Keeping.BOTH_ROUNDED):
        band = 2.0 * made.loop.valve.static
        finest = 0.25 * band if c.friction is not Friction.NONE else 0.1 * op_range
        fitting = [step for step in OP_STEPS if step <= finest] or [0.5 * finest]
        op = rounded(op, float(random.choice(fitting)))
    if c.keeping in (Keeping.PV_ROUNDED, Keeping.BOTH_ROUNDED):
        pv = rounded(pv, pv_range / random.uniform(10.0, 60.0))
    longest = int(random.integers(20, 60))
    if c.keeping is Keeping.EXCEPTION:
        op = excepted(op, random.uniform(0.01, 0.06) * op_range, longest)
        pv = excepted(pv, random.uniform(0.02, 0.12) * pv_range, longest)
    elif c.keeping is Keeping.SWINGING_DOOR:
        op = swinging_door(op, random.uniform(0.005, 0.03) * op_range, longest)
        pv = swinging_door(pv, random.uniform(0.01, 0.05) * pv_range, longest)
    return op, pv


def _with_missing_rows(
    random: np.random.Generator, op: FloatArray, pv: FloatArray, sp: FloatArray, mask: QualityArray
) -> tuple[FloatArray, FloatArray, FloatArray, QualityArray]:
    """Return the signals with 1 to 5 % of the rows filled as a reader fills them.

    OP and SP are held, PV is interpolated.
    """
    count = len(op)
    missing = random.random(count) < random.uniform(0.01, 0.05)
    missing[[0, -1]] = False
    there = np.flatnonzero(~missing)
    before = there[np.searchsorted(there, np.arange(count), side="right") - 1]
    filled = mask.copy()
    filled[missing & (mask == Quality.GOOD)] = Quality.HELD
    pv = np.interp(np.arange(count), there, pv[there])
    return op[before], np.asarray(pv), sp[before], filled
