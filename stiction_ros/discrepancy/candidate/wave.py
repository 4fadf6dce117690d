"""Disturbances where they enter: beside the stem of a valve, or on an output."""

from __future__ import annotations

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.candidate.waves import DriftWave, ShapedWave, SineWave, StepWave, Wave
from stiction_ros.discrepancy.likelihood.noise import MAX_ORDER, left_by, projector
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import (
    Behaviour,
    FloatArray,
    Seen,
    SquareDisturbance,
    TriangleDisturbance,
    about,
)

PEAKS = 6
SURPRISES = 12
SMALL = 0.01  # %, of a wave by which a process that is not linear is asked for its slope
SAME = 1e-3  # of a wave's length, that another one and the start of the record may leave of it

# What no record of OP and PV tells from a disturbance of an output, or from a load.
_AT_SENSOR = {"step": "bias_step", "drift": "drift"}
_IN_VALVE = {"step": "offset"}


class DisturbanceCandidate(Candidate):
    """A wave that is added to one output."""

    def __init__(self, run: FreeRun, output: int, wave: Wave) -> None:
        """Take the output's index and the shape."""
        self.output, self.wave = output, wave
        tag = run.model.outputs[output]
        self.place, self.effect = f"disturbance:{tag}", wave.effect
        self.axes, self.factors, self.dated = wave.axes, wave.factors, wave.dated
        self.sharp = isinstance(wave, ShapedWave)
        self.twins = ()
        if wave.effect in _AT_SENSOR:
            self.twins = ((f"sensor:{tag}", _AT_SENSOR[wave.effect]),)

    def grid(self) -> FloatArray:
        return self.wave.grid()

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        return Response({}, {self.output: self.wave.columns(run, points)})

    def reference(self, seen: Seen) -> tuple[float, ...]:
        return _reference(self.wave, seen)

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        return self.wave.behaviour(point, factors)


def _reference(wave: Wave, seen: Seen) -> tuple[float, ...]:
    """Return figures of engineering size: ten periods, or the middle of the records."""
    if isinstance(wave, SineWave | ShapedWave):
        return (10.0 / len(seen.values),)
    return about(wave.effect).reference(seen)


class LoadCandidate(Candidate):
    """A wave that enters the process beside the stem of one valve, % of travel."""

    def __init__(self, run: FreeRun, valve: int, wave: Wave) -> None:
        """Take the valve's index and the shape."""
        self.valve, self.wave = valve, wave
        tag = run.model.valves[valve].name
        self.place, self.effect = f"load:{tag}", wave.effect
        self.axes, self.factors, self.dated = wave.axes, wave.factors, wave.dated
        self.sharp = isinstance(wave, ShapedWave)
        self.twins = ()
        if wave.effect in _IN_VALVE:
            self.twins = ((f"valve:{tag}", _IN_VALVE[wave.effect]),)

    def grid(self) -> FloatArray:
        return self.wave.grid()

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        waves = self.wave.columns(run, points)
        count, size, factors = waves.shape
        entering = run.stems[:, self.valve, None] + SMALL * waves.reshape(count, -1)
        sizes = {}
        for i in range(run.forced.shape[1]):
            if run.responses.reaches(i, self.valve):
                moved = run.drive(i, self.valve, entering)
                moved -= run.forced[:, i : i + 1]
                sizes[i] = (moved / SMALL).reshape(count, size, factors)
        return Response({}, sizes)

    def reference(self, seen: Seen) -> tuple[float, ...]:
        return _reference(self.wave, seen)

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        return self.wave.behaviour(point, factors)


def disturbance_candidates(
    run: FreeRun, gap: FloatArray, whitened: list[FloatArray]
) -> list[Candidate]:
    """Return the disturbances of every output and the loads of every valve.

    A load that the free run does not tell from a disturbance of an output (a sine, and a ramp
    through a process that settles) is a twin of that one.

    Args:
        run: of the current model.
        gap: with the free columns taken out, shape (N, p); shows where lines are.
        whitened: per output the innovations, shape (N,).
    """
    found: list[Candidate] = []
    part = run.runs.longest
    lowest = 3.0 / (part.stop - part.start)
    for i in range(gap.shape[1]):
        moments = surprises(run, [whitened[i]])
        lines = spectral_lines([gap[part, i], whitened[i][part]], lowest)
        found += [DisturbanceCandidate(run, i, wave) for wave in _waves(run, moments, lines)]
    for j in range(len(run.model.valves)):
        reached = [i for i in range(gap.shape[1]) if run.responses.reaches(i, j)]
        if not reached:
            continue
        moments = surprises(run, [whitened[i] for i in reached])
        values = [each for i in reached for each in (gap[part, i], whitened[i][part])]
        waves = _waves(run, moments, spectral_lines(values, lowest))
        found += _told_apart(run, [LoadCandidate(run, j, wave) for wave in waves], found)
    return found


def _waves(run: FreeRun, moments: FloatArray, lines: FloatArray) -> list[Wave]:
    return [
        StepWave(run, moments),
        DriftWave(),
        SineWave(run, lines),
        ShapedWave(run, lines, SquareDisturbance),
        ShapedWave(run, lines, TriangleDisturbance),
    ]


def _told_apart(
    run: FreeRun, loads: list[LoadCandidate], disturbances: list[Candidate]
) -> list[Candidate]:
    """Return the loads that some record tells from a disturbance; the others become twins."""
    kept: list[Candidate] = []
    for load in loads:
        point = load.values(load.grid()[:1])
        response = load.respond(run, point)
        same = None
        if load.effect in ("drift", "sine") and len(response.outputs) == 1:
            (output,) = response.outputs
            same = next(
                each
                for each in disturbances
                if isinstance(each, DisturbanceCandidate)
                and (each.output, each.effect) == (output, load.effect)
            )
            wave = same.wave.columns(run, point)[:, 0]
            basis = projector(np.hstack([wave, run.free[output]]))
            left = left_by(basis, response.sizes[output][:, 0])
            if float(np.sum(left**2)) > SAME**2 * float(np.sum(response.sizes[output] ** 2)):
                same = None
        if same is None:
            kept.append(load)
        else:
            same.twins = (*same.twins, load.key)
    return kept


def surprises(run: FreeRun, innovations: list[FloatArray]) -> FloatArray:
    """Return the moments of the largest innovations, seconds since the first sample.

    Noise with a long memory takes up a step but for the sample at which it comes.
    """
    found: list[FloatArray] = []
    for each in innovations:
        sizes = np.abs(each)
        for rows in run.runs.slices:
            sizes[rows.start : rows.start + run.responses.skip + MAX_ORDER] = 0.0
        found.append(run.runs.time[np.argsort(-sizes, kind="stable")[:SURPRISES]])
    return np.concatenate(found)


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
