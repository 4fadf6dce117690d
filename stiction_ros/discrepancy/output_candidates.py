"""Candidates behind the valves: in the process, as a disturbance, at the sensor."""

from __future__ import annotations

import math

import numpy as np

from stiction_ros.discrepancy.candidates import Axis, Candidate, GridBehaviour, Response
from stiction_ros.discrepancy.free_run import FreeRun, end_to_end
from stiction_ros.discrepancy.noise import MAX_ORDER
from stiction_ros.discrepancy.valve_candidates import lag_axis
from stiction_ros.effects import (
    Behaviour,
    DriftDisturbance,
    ExtraDelay,
    ExtraPole,
    FloatArray,
    Leak,
    ProcessGain,
    SineDisturbance,
    StepDisturbance,
)
from stiction_ros.processes import Process

LONGEST_DELAY = 20
PEAKS = 6
SURPRISES = 12
INTEGRATES = 0.05  # of the record: a process with a longer time constant may leak


class OutputCandidate(Candidate):
    """A change of one output alone."""

    def __init__(self, run: FreeRun, output: int, place: str, effect: str) -> None:
        """Take the output's index and the kind of place, such as ``process``."""
        self.output = output
        self.place = f"{place}:{run.model.outputs[output]}"
        self.effect = effect

    def twin(self, run: FreeRun, place: str, effect: str) -> OutputCandidate:
        """Name another effect that no record of OP and PV tells from this one."""
        self.twins = (*self.twins, (f"{place}:{run.model.outputs[self.output]}", effect))
        return self


class FilterCandidate(OutputCandidate):
    """A linear change between process and sensor: pole, delay, leak."""

    def __init__(self, run: FreeRun, output: int, kind: type[GridBehaviour], axis: Axis) -> None:
        """Take the output's index, the behaviour and its one figure."""
        super().__init__(run, output, "process", kind.effect)
        self.kind, self.axes = kind, (axis,)

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        parts = []
        for rows in run.runs.slices:
            values = run.forced[rows, self.output]
            step = run.runs.sample_time
            start = self.starts(points, float(values[0]))
            parts.append(self.kind.simulate_grid(points[:, :1], values, start, step))
        response = end_to_end(parts)
        response -= run.forced[:, self.output, None]
        return Response({self.output: response})

    def starts(self, points: FloatArray, first: float) -> FloatArray:
        """Return what the filters rest at before the first sample, shape (G,)."""
        return np.full(len(points), first)

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        return self.kind.from_mapping({self.kind.parameters()[0].key: float(point[0])})


class PoleCandidate(FilterCandidate):
    """One more lag of the output, by its time constant and where it begins."""

    def __init__(self, run: FreeRun, output: int) -> None:
        """Take the output's index."""
        super().__init__(run, output, ExtraPole, lag_axis(run))
        span = float(np.ptp(run.forced[:, output]))
        self.axes = (*self.axes, Axis(-10.0 * span, 10.0 * span, 1, linear=True))

    def starts(self, points: FloatArray, first: float) -> FloatArray:
        return first + points[:, 1]

    def count(self, point: FloatArray) -> int:
        return 1


class GainCandidate(OutputCandidate):
    """Another gain: the free run itself, by a factor."""

    factors = 1

    def __init__(self, run: FreeRun, output: int) -> None:
        """Take the output's index."""
        super().__init__(run, output, "process", "gain")

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        return Response({}, {self.output: run.forced[:, self.output][:, None, None]})

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        return ProcessGain(float(np.clip(1.0 + factors[0], 0.01, 100.0)))


class StepCandidate(OutputCandidate):
    """A step of PV at one moment."""

    factors = 1
    dated = True

    def __init__(self, run: FreeRun, output: int, moments: FloatArray) -> None:
        """Take the output's index and moments, seconds, at which PV surprises most."""
        super().__init__(run, output, "disturbance", "step")
        self._moments = moments
        self.twin(run, "sensor", "bias_step")
        step, last = run.runs.sample_time, float(run.runs.time.max())
        self.axes = (Axis(0.02 * last, 0.98 * last, 60),)
        self._step = step

    def grid(self) -> FloatArray:
        axis = self.axes[0]
        moments = np.clip(self._moments, axis.low, axis.high)
        return np.unique(np.concatenate([axis.grid(), moments]))[:, None]

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        wave = run.runs.time[:, None] >= points[:, 0] - 1e-9
        return Response({}, {self.output: wave.astype(float)[:, :, None]})

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        onset = float(np.ceil(point[0] / self._step - 1e-9)) * self._step
        return StepDisturbance(onset, float(factors[0]))


class DriftCandidate(OutputCandidate):
    """A ramp of PV from the first sample on."""

    factors = 1

    def __init__(self, run: FreeRun, output: int) -> None:
        """Take the output's index."""
        super().__init__(run, output, "disturbance", "drift")
        self.twin(run, "sensor", "drift")

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        return Response({}, {self.output: run.runs.time[:, None, None]})

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        return DriftDisturbance(float(factors[0]))


class SineCandidate(OutputCandidate):
    """A sine on PV, searched near the lines of the gap's own spectrum."""

    factors = 2

    def __init__(self, run: FreeRun, output: int, lines: FloatArray) -> None:
        """Take the output's index and cycles per sample at which the gap has lines."""
        super().__init__(run, output, "disturbance", "sine")
        rows = run.runs.longest
        self._bin = 1.0 / (rows.stop - rows.start)
        self._lines = lines
        self.axes = (Axis(2.0 * self._bin, 0.45, 2 * int(0.45 / self._bin)),)

    def grid(self) -> FloatArray:
        offsets = np.array([-0.5, -0.25, 0.0, 0.25, 0.5]) * self._bin
        return np.unique(self._lines[:, None] + offsets).reshape(-1, 1)

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        angle = 2.0 * np.pi * (run.runs.time[:, None] / run.runs.sample_time) * points[:, 0]
        return Response({}, {self.output: np.stack([np.sin(angle), np.cos(angle)], axis=2)})

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        return SineDisturbance(
            float(np.hypot(*factors)),
            run.runs.sample_time / float(point[0]),
            float(np.arctan2(factors[1], factors[0])),
        )


def slowest(process: Process, sample_time: float) -> float:
    """Return the longest time constant of a process, samples; inf where it integrates."""
    poles = np.abs(np.linalg.eigvals(process.linear(sample_time).a))
    largest = float(poles.max(initial=0.0))
    if largest >= 1.0 - 1e-9:
        return math.inf
    return -1.0 / math.log(largest) if largest > 0.0 else 0.0


def surprises(run: FreeRun, innovations: FloatArray) -> FloatArray:
    """Return the moments of the largest innovations, seconds since the first sample.

    Noise with a long memory takes up a step but for the sample at which it comes.
    """
    sizes = np.abs(innovations)
    for rows in run.runs.slices:
        sizes[rows.start : rows.start + run.responses.skip + MAX_ORDER] = 0.0
    return np.asarray(run.runs.time[np.argsort(-sizes, kind="stable")[:SURPRISES]])


def spectral_lines(values: list[FloatArray], lowest: float) -> FloatArray:
    """Return the strongest lines of a gap, raw and whitened, in cycles per sample."""
    found: list[float] = []
    for each in values:
        power = np.abs(np.fft.rfft(each - each.mean(), 2 * len(each))) ** 2
        frequency = np.arange(len(power)) / (2.0 * len(each))
        power[(frequency < lowest) | (frequency > 0.45)] = 0.0
        for _ in range(PEAKS):
            peak = int(np.argmax(power))
            found.append(float(frequency[peak]))
            power[max(peak - 3, 0) : peak + 4] = 0.0
    return np.unique(found)


def output_candidates(run: FreeRun, gap: FloatArray, whitened: list[FloatArray]) -> list[Candidate]:
    """Return the candidates behind the valves.

    Args:
        run: of the current model.
        gap: with the free columns taken out, shape (N, p); shows where lines are.
        whitened: per output the innovations, shape (N,).
    """
    found: list[Candidate] = []
    part = run.runs.longest
    longest = part.stop - part.start
    step = run.runs.sample_time
    memory = slowest(run.model.process, step)
    for i in range(gap.shape[1]):
        moves = float(np.ptp(run.forced[:, i])) > 0.0
        if moves:
            found += [
                GainCandidate(run, i),
                PoleCandidate(run, i).twin(run, "sensor", "lag"),
                FilterCandidate(
                    run, i, ExtraDelay, Axis(1.0, LONGEST_DELAY, LONGEST_DELAY, whole=True)
                ),
            ]
            if memory > INTEGRATES * longest:
                lowest = max(0.3 / longest, 0.5 / memory) / step
                rates = Axis(lowest, 0.3 / step, 18, logarithmic=True)
                found.append(FilterCandidate(run, i, Leak, rates))
        lines = spectral_lines([gap[part, i], whitened[i][part]], 3.0 / longest)
        found += [
            StepCandidate(run, i, surprises(run, whitened[i])),
            DriftCandidate(run, i),
            SineCandidate(run, i, lines),
        ]
    return found
