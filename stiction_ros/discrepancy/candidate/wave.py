"""Disturbances where they enter: beside the stem of a valve, or on an output."""

import dataclasses
from typing import Self

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.candidate.waves import (
    FASTEST,
    DriftWave,
    ShapedWave,
    SineWave,
    StepWave,
    Wave,
)
from stiction_ros.discrepancy.likelihood.noise import MAX_ORDER, left_by, projector
from stiction_ros.discrepancy.simulation.free_run import SMALL, FreeRun
from stiction_ros.effects import (
    Behaviour,
    FloatArray,
    Seen,
    SquareDisturbance,
    TriangleDisturbance,
    about,
)
from stiction_ros.signals.autoregression import TINY

PEAKS, STANDING_OUT = 6, 3
NEIGHBOURS = 51  # frequencies, half a spectral line apart, whose median a line is held against
SURPRISES = 12
SAME = 1e-3  # of a wave's length, that another one and the start of the record may leave of it

# What no record of OP and PV tells from a disturbance of an output, or from a load.
_AT_SENSOR = {"step": "bias_step", "drift": "drift"}
_IN_VALVE = {"step": "offset"}


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class WaveCandidate(Candidate):
    """A wave that enters somewhere."""

    wave: Wave  # its shape
    index: int  # of the output that it is added to, or of the valve beside which it enters

    @classmethod
    def of(cls, place: str, index: int, wave: Wave, twins: tuple[tuple[str, str], ...]) -> Self:
        """Return the candidate of a shape at a place, and what is not told from it."""
        return cls(
            place=place,
            effect=wave.effect,
            axes=wave.axes,
            factors=wave.factors,
            twins=twins,
            dated=wave.dated,
            sharp=isinstance(wave, SineWave | ShapedWave | StepWave),
            wave=wave,
            index=index,
        )

    def count(self, point: FloatArray) -> int:
        return super().count(point) + self.wave.further

    def grid(self) -> FloatArray:
        return self.wave.grid()

    def reference(self, seen: Seen) -> tuple[float, ...]:
        """Return figures of engineering size: ten periods, or the middle of the records."""
        if isinstance(self.wave, SineWave | ShapedWave):
            return (10.0 / len(seen.values),)
        return about(self.effect).reference(seen)

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour:
        return self.wave.behaviour(point, factors)


class DisturbanceCandidate(WaveCandidate):
    """A wave that is added to one output."""

    @classmethod
    def on(cls, run: FreeRun, output: int, wave: Wave) -> Self:
        """Return the candidate of an output by its index."""
        tag, same = run.model.outputs[output], _AT_SENSOR.get(wave.effect)
        return cls.of(
            f"disturbance:{tag}", output, wave, ((f"sensor:{tag}", same),) if same else ()
        )

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        return Response({}, {self.index: self.wave.columns(run, points)})


class LoadCandidate(WaveCandidate):
    """A wave that enters the process beside the stem of one valve, % of travel."""

    @classmethod
    def beside(cls, run: FreeRun, valve: int, wave: Wave) -> Self:
        """Return the candidate of a valve by its index."""
        tag, same = run.model.valves[valve].name, _IN_VALVE.get(wave.effect)
        return cls.of(f"load:{tag}", valve, wave, ((f"valve:{tag}", same),) if same else ())

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        waves = self.wave.entering(run, points)
        count, size, factors = waves.shape
        entering = run.stems[:, self.index, None] + SMALL * waves.reshape(count, -1)
        sizes = {}
        for i in range(run.forced.shape[1]):
            if run.responses.reaches(i, self.index):
                moved = run.drive(i, self.index, entering)
                moved -= run.forced[:, i : i + 1]
                sizes[i] = (moved / SMALL).reshape(count, size, factors)
        return Response({}, sizes)


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
        found += [DisturbanceCandidate.on(run, i, wave) for wave in _waves(run, moments, lines)]
    for j in range(len(run.model.valves)):
        reached = [i for i in range(gap.shape[1]) if run.responses.reaches(i, j)]
        if not reached:
            continue
        moments = surprises(run, [whitened[i] for i in reached])
        values = [each for i in reached for each in (gap[part, i], whitened[i][part])]
        waves = _waves(run, moments, spectral_lines(values, lowest))
        for load in (LoadCandidate.beside(run, j, wave) for wave in waves):
            same = _not_told(run, load, found)
            if same is None:
                found.append(load)
            else:
                found[same] = found[same].or_else(*load.key)
    return found


def _waves(run: FreeRun, moments: FloatArray, lines: FloatArray) -> list[Wave]:
    return [
        StepWave.of(run, moments),
        DriftWave(),
        SineWave.of(run, lines),
        ShapedWave.of(run, lines, SquareDisturbance),
        ShapedWave.of(run, lines, TriangleDisturbance),
    ]


def _not_told(run: FreeRun, load: LoadCandidate, found: list[Candidate]) -> int | None:
    """Return the place of the disturbance that no record tells from a load; None if all do."""
    point = load.values(load.grid()[:1])
    response = load.respond(run, point)
    if load.effect not in ("drift", "sine") or len(response.outputs) != 1:
        return None
    (output,) = response.outputs
    place, same = next(
        (k, each)
        for k, each in enumerate(found)
        if isinstance(each, DisturbanceCandidate)
        and (each.index, each.effect) == (output, load.effect)
    )
    wave = same.wave.columns(run, point)[:, 0]
    basis = projector(np.hstack([wave, run.free[output]]))
    left = left_by(basis, response.sizes[output][:, 0])
    told = float(np.sum(left**2)) > SAME**2 * float(np.sum(response.sizes[output] ** 2))
    return None if told else place


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
    """Return the strongest lines of a gap, raw and whitened, in cycles per sample.

    And those that stand out most among their neighbours: behind slow noise, a wave is not what is
    strongest.
    """
    from scipy.ndimage import median_filter

    found: list[float] = []
    for each in values:
        power = np.abs(np.fft.rfft(each - each.mean(), 2 * len(each))) ** 2
        frequency = np.arange(len(power)) / (2.0 * len(each))
        outside = (frequency < lowest) | (frequency > FASTEST)
        beside = np.maximum(median_filter(power, NEIGHBOURS, mode="nearest"), TINY)
        for sizes, count in ((power, PEAKS), (power / beside, STANDING_OUT)):
            sizes[outside] = 0.0
            for _ in range(count):
                peak = int(np.argmax(sizes))
                found.append(float(frequency[peak]))
                sizes[max(peak - 3, 0) : peak + 4] = 0.0
    return np.unique(found)
