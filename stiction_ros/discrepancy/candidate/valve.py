"""Candidates at a valve: one more effect behind those that the model has already."""

import dataclasses
import math
from typing import Any, Self

import numpy as np

from stiction_ros.discrepancy.candidate.base import (
    Candidate,
    KindCandidate,
    Lagging,
    Response,
    between_axes,
    lag_axis,
)
from stiction_ros.discrepancy.measures import ALONG, NEGLIGIBLE, QUARTER, ROUNDING, SLIGHT
from stiction_ros.discrepancy.simulation.between import not_yet_moved
from stiction_ros.discrepancy.simulation.free_run import FreeRun, over_samples
from stiction_ros.discrepancy.simulation.responses import end_to_end
from stiction_ros.effects import (
    Axis,
    Backlash,
    Behaviour,
    Characteristic,
    CubicCharacteristic,
    FloatArray,
    HeStiction,
    Lag,
    Saturation,
    Seen,
    Slew,
    XchStiction,
)
from stiction_ros.effects.behaviour import BoolArray

AT_REST = 1.0 - ROUNDING  # of half a deadband, how far off OP a stem rests at its edge
SHORT_OF_A_SLIP = 0.98  # of f_S; where there is a jump it rests at f_D, well inside


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ValveCandidate(KindCandidate):
    """A behaviour at the end of a valve's chain.

    Its stems start at rest at the first OP; stiction, backlash, a lag and a slew have one more
    figure, where the stem stood then.
    """

    valve: int  # its index

    @classmethod
    def at(
        cls, run: FreeRun, valve: int, kind: type[Behaviour], axes: tuple[Axis, ...], **more: Any
    ) -> Self:
        """Return the candidate at a valve by its index, with the figures that are searched."""
        place = f"valve:{run.model.valves[valve].name}"
        return cls(place=place, effect=kind.effect, axes=axes, valve=valve, kind=kind, **more)

    def signal(self, run: FreeRun) -> FloatArray:
        return run.stems[:, self.valve]

    @property
    def smooth(self) -> bool:
        return self.curved or self.kind in (Slew, Lag)

    def stems(self, run: FreeRun, points: FloatArray, *, from_measured: bool = False) -> FloatArray:
        """Return stem positions, shape (N, G), %.

        Args:
            run: of the current model.
            points: shape (G, axes).
            from_measured: whether stems that are recorded start where they were, whatever the
                points say of that.
        """
        low, high = run.model.limits[self.valve]
        rows, valve = self.rows(points), run.model.valve_names[self.valve]
        parts = []
        every = run.runs.sample_time / run.runs.scanned
        for record, part in zip(
            run.runs.records, map(run.runs.at_scans, run.runs.slices), strict=True
        ):
            values = run.scanned[part, self.valve]
            start = float(values[0]) + self.lead(points)
            if from_measured and record.stem is not None:
                start = np.full(len(points), record.stem[0, record.valves.index(valve)])
            parts.append(self.kind.simulate_grid(rows, values, start, every))
        stems = end_to_end(parts)
        return over_samples(np.clip(stems, low, high, out=stems), run.runs)

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        stems = self.stems(run, points)
        shifts, least = {}, ROUNDING * max(float(np.ptp(run.forced)), 1e-9)
        for i in range(run.forced.shape[1]):
            if not run.responses.reaches(i, self.valve):
                continue
            shift = run.drive(i, self.valve, stems)
            shift -= run.forced[:, i : i + 1]
            if max(float(shift.max()), -float(shift.min())) > least:
                shifts[i] = shift
        return Response(shifts or {0: np.zeros(stems.shape)})


class Sliding(ValveCandidate):
    """A friction or a slew. Its last figure, if asked, is by how many samples the stem moves late.

    A slew by -½ acts on the samples alone, as in loop models.
    """

    def stems(self, run: FreeRun, points: FloatArray, *, from_measured: bool = False) -> FloatArray:
        stems = super().stems(run, points, from_measured=from_measured)
        if not self.axes[-1].linear:
            return stems
        rates, middle = (points[:, 0], 0.5) if self.kind is Slew else (None, 0.0)
        late = middle + points[:, -1]
        return stems - late * not_yet_moved(run, stems, rates) if late.any() else stems


class StictionCandidate(Sliding):
    """Stiction by f_S, f_D / f_S and the place of the stem in its band at the start."""

    def rows(self, points: FloatArray) -> FloatArray:
        return np.column_stack([points[:, 0], points[:, 0] * points[:, 1]])

    def lead(self, points: FloatArray) -> FloatArray:
        return SHORT_OF_A_SLIP * (points[:, 0] * points[:, 2])

    @property
    def stepped(self) -> bool:
        return True

    def leaps(self, point: FloatArray) -> bool:
        # A smaller one may be what the stem moves between two samples.
        return float(1.0 - point[1]) >= SLIGHT * float(1.0 + point[1])

    def of_cube(self, cubes: FloatArray) -> FloatArray:
        """Return points, shape (G, axes), for shares, (G, 3), of all sums, jumps and starts.

        The sum of the frictions, how far OP goes back before the stem follows, is told well by any
        record; their difference, the jump, much less.
        """
        low, high = self.axes[0].low, self.axes[0].high
        totals = 2.0 * low * (high / low) ** cubes[:, 0]
        static = np.clip(0.5 * totals * (1.0 + cubes[:, 1]), low, high)
        ratios = (1.0 - cubes[:, 1]) / (1.0 + cubes[:, 1])
        late = np.zeros((len(cubes), len(self.axes) - 3))
        return np.column_stack([static, ratios, 2.0 * cubes[:, 2] - 1.0, late])

    def box(self, point: FloatArray, cubes: FloatArray, size: float) -> FloatArray:
        """Return points in a box around one, with any start of the stem.

        Args:
            point: values, shape (axes,).
            cubes: points between 0 and 1, shape (G, axes).
            size: of the box, 1 for the largest, a quarter to either side.
        """
        span = math.log(self.axes[0].high / self.axes[0].low)
        around = QUARTER * size * np.array([1.0 / span, 1.0]) * (2.0 * cubes[:, :2] - 1.0)
        near = np.clip(self.cube(point)[:2] + around, 0.0, 1.0)
        return self.of_cube(np.column_stack([near, cubes[:, 2]]))

    def cube(self, point: FloatArray) -> FloatArray:
        """Return the shares that :meth:`of_cube` makes a point of, shape (3,)."""
        (static, ratio, lead), (low, high) = point[:3], (self.axes[0].low, self.axes[0].high)
        total = math.log(0.5 * static * (1.0 + ratio) / low, high / low)
        return np.asarray(
            np.clip([total, (1.0 - ratio) / (1.0 + ratio), 0.5 * (lead + 1.0)], 0.0, 1.0)
        )


class BacklashCandidate(Sliding):
    """Backlash by its band and the place of the stem in it at the start."""

    def lead(self, points: FloatArray) -> FloatArray:
        return 0.5 * AT_REST * (points[:, 0] * points[:, 1])


class LagCandidate(Lagging, ValveCandidate):
    """A lag of the stem."""

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        shifts = super().answer(run, points).shifts
        return Response(
            {i: v + self.between(run, points, i, self.valve) for i, v in shifts.items()}
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class CubicCandidate(ValveCandidate):
    """A characteristic of two figures, by the first and the best second one."""

    low: float  # low, high: between which OP moves, %
    high: float

    @property
    def curved(self) -> bool:
        return True

    @property
    def absorbed(self) -> bool:
        """A fitted process takes the slope of the curve up."""
        return True

    def large_enough(self, point: FloatArray, factors: FloatArray) -> bool:
        """Refuse curves that are straight where OP moves, or fall."""
        travel = np.linspace(self.low, self.high, ALONG)
        curve = travel + CubicCharacteristic.shapes(travel) @ point
        chord = np.linspace(curve[0], curve[-1], ALONG)
        bent = np.abs(curve - chord).max() >= NEGLIGIBLE * abs(curve[-1] - curve[0])
        return bool(bent and np.all(np.diff(curve) > 0.0))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SaturationCandidate(ValveCandidate):
    """A stem that stops short of what OP asks, at one end or both."""

    limits: tuple[float, float]  # of the valve itself, %

    def rows(self, points: FloatArray) -> FloatArray:
        return np.column_stack([np.minimum(points[:, 0], points[:, 1]), points.max(axis=1)])

    def count(self, point: FloatArray) -> int:
        low, high = self.axes[0].low, self.axes[1].high
        return int(point[0] > low) + int(point[1] < high)

    def possible(self, points: FloatArray) -> BoolArray:
        """Refuse ends that leave hardly any travel: whatever holds it, such a valve stands."""
        span = self.axes[1].high - self.axes[0].low
        return np.asarray(np.abs(points[:, 1] - points[:, 0]) >= SLIGHT * span)

    def large_enough(self, point: FloatArray, factors: FloatArray) -> bool:
        return True

    def reference(self, seen: Seen) -> tuple[float, ...]:
        return self.axes[0].low, float(np.quantile(seen.values, 0.95))

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        """Return the saturation; an end that OP never reaches is the valve's, if any."""
        low, high = self.rows(point[None, :])[0].tolist()
        if low <= self.axes[0].low and np.isfinite(self.limits[0]):
            low = self.limits[0]
        if high >= self.axes[1].high and np.isfinite(self.limits[1]):
            high = self.limits[1]
        return Saturation(low, high)


def departures(run: FreeRun, candidate: Candidate, point: FloatArray) -> int:
    """Return how often a candidate's stem leaves a rest.

    0 for what acts at no valve, and where all travel together is less than the band.
    """
    if not isinstance(candidate, ValveCandidate):
        return 0
    stems = candidate.stems(run, point[None, :])[:, 0]
    moves = [np.diff(stems[rows]) for rows in run.runs.slices]
    if sum(float(np.abs(each).sum()) for each in moves) < float(point[0]):
        return 0
    return sum(int(((each[1:] != 0.0) & (each[:-1] == 0.0)).sum()) for each in moves)


def valve_candidates(run: FreeRun) -> list[Candidate]:
    """Return the candidates at every valve whose OP moves."""
    found: list[Candidate] = []
    for j in range(len(run.model.valves)):
        op = run.stems[:, j]
        span = float(np.quantile(op, 0.998) - np.quantile(op, 0.002))
        if span > 0.0:
            found += _at_valve(run, j, op, span)
    return found


def _at_valve(run: FreeRun, j: int, op: FloatArray, span: float) -> list[Candidate]:
    step = run.runs.sample_time
    moves = np.abs(np.concatenate([np.diff(op[rows]) for rows in run.runs.slices]))
    fastest = max(float(moves.max()), 1e-9) / step
    low, high = float(op.min()), float(op.max())
    # A controller that winds up spends most of its time beyond the stem's end.
    lower, upper = np.quantile(op, [0.95, 0.05]).tolist()
    start, within = Axis(-1.0, 1.0, 1, start=True), Axis(-span, span, 1, start=True)
    away = Axis(-2.0 * span, 2.0 * span, 1, linear=True, start=True)
    between = between_axes(any(run.runs.between[j : j + 1]))
    late = (Axis(-1.0, 1.0, 1, linear=True),) if between else ()

    def sizes(least: float, most: float, count: int) -> Axis:
        return Axis(least, most, count, logarithmic=True)

    largest = (1.0 - SLIGHT) * span  # what never moves the stem cannot be told
    figures = sizes(0.01 * span, largest, 50), Axis(0.0, 1.0, 9, natural=True), start, *late
    bands = sizes(0.02 * span, 1.8 * span, 24), start, *late
    rates = sizes(0.003 * fastest, 0.95 * fastest, 24), within
    ends = Axis(low, lower, 14, natural=True), Axis(upper, high, 14, natural=True)
    bends = Axis(-40.0, 40.0, 17), Axis(-30.0, 30.0, 1, linear=True)
    limits = tuple(run.model.limits[j].tolist())
    return [
        StictionCandidate.at(run, j, HeStiction, figures, needle=True),
        StictionCandidate.at(run, j, XchStiction, figures),
        BacklashCandidate.at(run, j, Backlash, bands),
        Sliding.at(run, j, Slew, (*rates, *between)),
        LagCandidate.at(run, j, Lag, (lag_axis(run), away, *between)),
        SaturationCandidate.at(run, j, Saturation, ends, limits=limits),
        ValveCandidate.at(run, j, Characteristic, (Axis(-4.0, 4.0, 18),)),
        CubicCandidate.at(run, j, CubicCharacteristic, bends, low=low, high=high),
    ]
