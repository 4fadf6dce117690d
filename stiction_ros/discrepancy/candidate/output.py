"""Candidates between the valves and the sensors, and rivals outside the catalogue."""

import dataclasses
import math
from typing import Self

import numpy as np

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.candidate.base import (
    Candidate,
    KindCandidate,
    Lagging,
    Response,
    between_axes,
    lag_axis,
)
from stiction_ros.discrepancy.measures import LONGEST_DELAY, QUARTER, SLIGHT
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.discrepancy.simulation.responses import end_to_end
from stiction_ros.effects import (
    Axis,
    Behaviour,
    ExtraDelay,
    ExtraPole,
    FloatArray,
    Lag,
    Leak,
    ProcessGain,
)
from stiction_ros.processes import Process

KNOTS = 6
LAGS = (0.0, 2.0, 6.0, 18.0)  # samples


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class OutputCandidate(Candidate):
    """A change of one output alone."""

    output: int  # its index

    def signal(self, run: FreeRun) -> FloatArray:
        return run.forced[:, self.output]


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FilterCandidate(KindCandidate, OutputCandidate):
    """A linear change between process and sensor, by its first figure: pole, delay, leak."""

    @classmethod
    def of(cls, run: FreeRun, output: int, kind: type[Behaviour], axes: tuple[Axis, ...]) -> Self:
        """Return the candidate of an output by its index, with the figures that are searched."""
        place = f"process:{run.model.outputs[output]}"
        return cls(place=place, effect=kind.effect, axes=axes, output=output, kind=kind)

    @property
    def smooth(self) -> bool:
        return True

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        parts = []
        for rows in run.runs.slices:
            values = run.forced[rows, self.output]
            step = run.runs.sample_time
            start = float(values[0]) + self.lead(points)
            parts.append(self.kind.simulate_grid(self.rows(points), values, start, step))
        response = end_to_end(parts)
        response -= run.forced[:, self.output, None]
        return Response({self.output: response})


class PoleCandidate(Lagging, FilterCandidate):
    """One more lag of the output."""

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        shifts = super().answer(run, points).shifts
        return Response({i: v + self.between(run, points, i) for i, v in shifts.items()})

    def keeps(self, run: FreeRun, point: FloatArray) -> float | None:
        return math.exp(-run.runs.sample_time / max(float(point[0]), 1e-9))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class GainCandidate(OutputCandidate):
    """Another gain: the free run itself, by a factor."""

    factors: int = 1

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        return Response({}, {self.output: run.forced[:, self.output][:, None, None]})

    def large_enough(self, point: FloatArray, factors: FloatArray) -> bool:
        """Refuse a process that hardly answers at all: that is a valve that does not move."""
        return abs(float(factors[0])) >= SLIGHT and 1.0 + float(factors[0]) >= QUARTER

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        return ProcessGain(float(np.clip(1.0 + factors[0], 0.01, 100.0)))


def slowest(process: Process, sample_time: float) -> float:
    """Return the longest time constant of a process, samples; inf where it integrates."""
    poles = np.abs(np.linalg.eigvals(process.linear(sample_time).a))
    largest = float(poles.max(initial=0.0))
    if largest >= 1.0 - 1e-9:
        return math.inf
    return -1.0 / math.log(largest) if largest > 0.0 else 0.0


def output_candidates(run: FreeRun) -> list[Candidate]:
    """Return the candidates in the process, for every output that moves."""
    found: list[Candidate] = []
    part = run.runs.longest
    longest = part.stop - part.start
    step = run.runs.sample_time
    memory = slowest(run.model.process, step)
    for i in range(run.forced.shape[1]):
        if float(np.ptp(run.forced[:, i])) <= 0.0:
            continue
        tag, span = run.model.outputs[i], float(np.ptp(run.forced[:, i]))
        start = Axis(-10.0 * span, 10.0 * span, 1, linear=True, start=True)
        delays = Axis(1.0, LONGEST_DELAY, LONGEST_DELAY, natural=True)
        found += [
            GainCandidate(place=f"process:{tag}", effect=ProcessGain.effect, output=i),
            PoleCandidate.of(
                run, i, ExtraPole, (lag_axis(run), start, *between_axes(any(run.runs.between)))
            ).or_else(f"sensor:{tag}", Lag.effect),
            FilterCandidate.of(run, i, ExtraDelay, (delays,)),
        ]
        if memory > SLIGHT * longest:
            lowest = max(0.3 / longest, 0.5 / memory) / step
            rates = Axis(lowest, 0.3 / step, 18, logarithmic=True)
            found.append(FilterCandidate.of(run, i, Leak, (rates,)))
    return found


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Decoy(OutputCandidate):
    """A rival outside the catalogue: where it wins, the catalogue does not name what is wrong."""

    inside: bool = False

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour | None:
        return None


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class GainChange(_Decoy):
    """A process whose gain changes at one moment."""

    effect: str = "gain that changes"
    factors: int = 2
    dated: bool = True

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        late = (run.runs.time[:, None] >= points[:, 0]).astype(float)
        free = run.forced[:, self.output, None] - run.forced[:, self.output].mean()
        return Response({}, {self.output: np.stack([late * free, late], axis=2)})


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Trend(_Decoy):
    """A slow unknown load: a cubic spline in time."""

    effect: str = "slow load"
    factors: int = KNOTS

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        from scipy.interpolate import BSpline

        at = run.runs.time / max(float(run.runs.time.max()), 1e-9)
        knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, KNOTS - 1), np.ones(3)])
        basis = BSpline.design_matrix(np.clip(at, 0.0, 1.0 - 1e-12), knots, 3).toarray()
        return Response({}, {self.output: basis[:, None, 1:]})


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Dynamics(_Decoy):
    """Other linear dynamics: the free run through several lags."""

    effect: str = "other dynamics"
    factors: int = len(LAGS) + 1
    most_of: float = 0.8  # lags between samples are not quite those of held signals

    @property
    def absorbed(self) -> bool:
        return True

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        parts = []
        for rows in run.runs.slices:
            values = run.forced[rows, self.output]
            late = np.concatenate([values[:1], values[:-1]]) - values[0]
            columns = [values]
            for lag in LAGS:
                keep = np.exp(-1.0 / lag) if lag else 0.0
                columns.append(lfilter([1.0 - keep], [1.0, -keep], late))
            parts.append(np.column_stack(columns))
        return Response({}, {self.output: np.vstack(parts)[:, None, :]})


def decoys(run: FreeRun) -> list[Candidate]:
    """Return the rivals outside the catalogue for every output."""
    found: list[Candidate] = []
    last, valves = float(run.runs.time.max()), run.model.valve_names
    for i, tag in enumerate(run.model.outputs):
        process, added = f"process:{tag}", f"disturbance:{tag}"
        places = (added, *(f"load:{valve}" for valve in valves))
        walks = tuple((place, "random_walk") for place in places)
        found.append(Trend(place=added, output=i, contains=walks))
        if float(np.ptp(run.forced[:, i])) > 0.0:
            steps = tuple((place, "step") for place in places)
            axes = (Axis(0.1 * last, 0.9 * last, 17),)
            found.append(GainChange(place=process, output=i, axes=axes, contains=steps))
            parts = [(process, name) for name in ("pole", "delay", "gain")]
            lags = [(f"valve:{valve}", "lag") for valve in valves]
            found.append(Dynamics(place=process, output=i, contains=(*parts, *lags)))
    return found
