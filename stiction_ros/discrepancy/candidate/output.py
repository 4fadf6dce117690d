"""Candidates in the process, between its valves and its sensors."""

import dataclasses
import math
from typing import Self

import numpy as np

from stiction_ros.discrepancy.candidate.base import (
    Candidate,
    Response,
    figures_of_lag,
    lag_axis,
    lasts,
    late_axes,
    later,
)
from stiction_ros.discrepancy.simulation.free_run import FreeRun, end_to_end
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

LONGEST_DELAY = 20
LEAST_CHANGE = 0.03  # of the gain
LEAST_GAIN = 0.25
INTEGRATES = 0.05  # of the record: a process with a longer time constant may leak


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class OutputCandidate(Candidate):
    """A change of one output alone."""

    output: int  # its index

    def signal(self, run: FreeRun) -> FloatArray:
        return run.forced[:, self.output]


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FilterCandidate(OutputCandidate):
    """A linear change between process and sensor: pole, delay, leak."""

    kind: type[Behaviour]  # the behaviour; its first figure is searched

    @classmethod
    def of(cls, run: FreeRun, output: int, kind: type[Behaviour], axes: tuple[Axis, ...]) -> Self:
        """Return the candidate of an output by its index, with the figures that are searched."""
        place = f"process:{run.model.outputs[output]}"
        return cls(place=place, effect=kind.effect, axes=axes, output=output, kind=kind)

    @property
    def smooth(self) -> bool:
        return True

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        parts = []
        for rows in run.runs.slices:
            values = run.forced[rows, self.output]
            step = run.runs.sample_time
            start = self.starts(points, float(values[0]))
            parts.append(self.kind.simulate_grid(points[:, :1], values, start, step))
        response = self.late(end_to_end(parts), points, run)
        response -= run.forced[:, self.output, None]
        return Response({self.output: response})

    def starts(self, points: FloatArray, first: float) -> FloatArray:
        """Return what the filters rest at before the first sample, shape (G,)."""
        return np.full(len(points), first)

    def late(self, values: FloatArray, points: FloatArray, run: FreeRun) -> FloatArray:
        """Return the outputs of the filters, shape (N, G), as late as they come."""
        return values

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        return self.kind.from_mapping({self.kind.parameters()[0].key: float(point[0])})


class PoleCandidate(FilterCandidate):
    """One more lag of the output, by its time constant, where it begins and how late it moves."""

    def large_enough(self, point: FloatArray, factors: FloatArray) -> bool:
        return lasts(self, point)

    def starts(self, points: FloatArray, first: float) -> FloatArray:
        return first + points[:, 1]

    def late(self, values: FloatArray, points: FloatArray, run: FreeRun) -> FloatArray:
        return later(values, points[:, 2:], run)

    def count(self, point: FloatArray) -> int:
        return figures_of_lag(point)

    def keeps(self, run: FreeRun, point: FloatArray) -> float | None:
        return math.exp(-run.runs.sample_time / max(float(point[0]), 1e-9))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class GainCandidate(OutputCandidate):
    """Another gain: the free run itself, by a factor."""

    factors: int = 1

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        return Response({}, {self.output: run.forced[:, self.output][:, None, None]})

    def large_enough(self, point: FloatArray, factors: FloatArray) -> bool:
        """Refuse a process that hardly answers at all: that is a valve that does not move."""
        return abs(float(factors[0])) >= LEAST_CHANGE and 1.0 + float(factors[0]) >= LEAST_GAIN

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
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
        start = Axis(-10.0 * span, 10.0 * span, 1, linear=True)
        delays = Axis(1.0, LONGEST_DELAY, LONGEST_DELAY, natural=True)
        found += [
            GainCandidate(place=f"process:{tag}", effect=ProcessGain.effect, output=i),
            PoleCandidate.of(
                run, i, ExtraPole, (lag_axis(run), start, *late_axes(any(run.runs.between)))
            ).or_else(f"sensor:{tag}", Lag.effect),
            FilterCandidate.of(run, i, ExtraDelay, (delays,)),
        ]
        if memory > INTEGRATES * longest:
            lowest = max(0.3 / longest, 0.5 / memory) / step
            rates = Axis(lowest, 0.3 / step, 18, logarithmic=True)
            found.append(FilterCandidate.of(run, i, Leak, (rates,)))
    return found
