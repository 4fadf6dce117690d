"""Disturbances: shapes in time that enter beside the stem of a valve, or on an output."""

import dataclasses
import math
from abc import abstractmethod
from typing import Any, Self

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.likelihood.least_squares import left_by, projector
from stiction_ros.discrepancy.measures import NEARLY_ALL, SIDES, TRACE, TRIED
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import (
    Axis,
    Behaviour,
    DriftDisturbance,
    FloatArray,
    Seen,
    SineDisturbance,
    SquareDisturbance,
    StepDisturbance,
    TriangleDisturbance,
)
from stiction_ros.signals.autoregression import TINY

LOAD, DISTURBANCE = "load", "disturbance"
FASTEST = NEARLY_ALL / 2.0  # cycles per sample; half a cycle is all that samples tell
SHAPED = FASTEST / 3.0  # of a square or a triangle: its third harmonic has to be seen
SLOWEST = 2.0  # cycles in the longest record
PHASES = 8
A_FREQUENCY = 3
"""Figures that a frequency counts as: what n samples tell of it grows with n³, of others with n
(P. M. Djurić, A model selection rule for sinusoids in white Gaussian noise, IEEE Transactions on
Signal Processing 44, 1996)."""
NEIGHBOURS = 51  # frequencies, half a spectral line apart, whose median a line is held against
SURPRISES = 12
_TURN = 2.0 * math.pi

# What no record of OP and PV tells from a shape at a place.
_TWINS = {
    (DISTURBANCE, StepDisturbance.effect): ("sensor", "bias_step"),
    (DISTURBANCE, DriftDisturbance.effect): ("sensor", "drift"),
    (LOAD, StepDisturbance.effect): ("valve", "offset"),
}


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class WaveCandidate(Candidate):
    """A shape in time, its size found by least squares, that enters at one place."""

    index: int  # of the output that it is added to, or of the valve beside which it enters
    sample_time: float  # s
    length: int  # of the longest record, samples
    factors: int = 1

    @classmethod
    def at(cls, run: FreeRun, kind: str, index: int, effect: str, **more: Any) -> Self:
        """Return the shape on an output, or beside the stem of a valve, by its index."""
        tag = (run.model.valve_names if kind == LOAD else run.model.outputs)[index]
        twin = _TWINS.get((kind, effect))
        return cls(
            place=f"{kind}:{tag}",
            effect=effect,
            twins=((f"{twin[0]}:{tag}", twin[1]),) if twin else (),
            index=index,
            sample_time=run.runs.sample_time,
            length=run.runs.longest.stop - run.runs.longest.start,
            **more,
        )

    @abstractmethod
    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        """Return the waves of size one, shape (N, G, factors), for points (G, axes)."""

    def entering(self, run: FreeRun, points: FloatArray) -> FloatArray:
        """Return what of the waves enters a process, as :meth:`columns` returns them."""
        return self.columns(run, points)

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        if self.place.startswith(DISTURBANCE):
            return Response({}, {self.index: self.columns(run, points)})
        waves = self.entering(run, points)
        flat = waves.reshape(len(waves), -1)
        reached = [i for i in range(run.forced.shape[1]) if run.responses.reaches(i, self.index)]
        return Response(
            {}, {i: run.slope(i, self.index, flat).reshape(waves.shape) for i in reached}
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class StepCandidate(WaveCandidate):
    """A step at one moment."""

    dated: bool = True
    sharp: bool = True

    @classmethod
    def of(cls, run: FreeRun, kind: str, index: int, moments: FloatArray) -> Self:
        """Return the step as it is searched in a record."""
        last = float(run.runs.time.max())
        axes = (Axis(0.02 * last, 0.98 * last, 60, natural=True),)
        return cls.at(run, kind, index, StepDisturbance.effect, axes=axes, moments=moments)

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        late = run.runs.time[:, None] >= points[:, 0] - 1e-9
        return late.astype(float)[:, :, None]

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        onset = float(np.ceil(point[0] / self.sample_time - 1e-9)) * self.sample_time
        return StepDisturbance(onset, float(factors[0]))


class DriftCandidate(WaveCandidate):
    """A ramp from the first sample on."""

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        return run.runs.time[:, None, None]

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        return DriftDisturbance(float(factors[0]))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class LineCandidate(WaveCandidate):
    """A wave that is searched near the lines of the gap's own spectrum."""

    lines: FloatArray  # of the gap, cycles per sample
    sharp: bool = True

    def near(self, fastest: float) -> FloatArray:
        """Return frequencies on and beside the lines, shape (K,)."""
        width = 1.0 / self.length
        beside = self.lines[:, None] + np.array(SIDES) * (0.5 * width)
        return np.unique(np.clip(beside, SLOWEST * width, fastest))

    def count(self, point: FloatArray) -> int:
        return super().count(point) + A_FREQUENCY - 1

    def reference(self, seen: Seen) -> tuple[float, ...]:
        """Return ten periods in the records."""
        return (10.0 / len(seen.values),)


class SineCandidate(LineCandidate):
    """A sine."""

    @classmethod
    def of(cls, run: FreeRun, kind: str, index: int, lines: FloatArray) -> Self:
        """Return the sine as it is searched in a record."""
        axes = (_frequencies(run, FASTEST),)
        name = SineDisturbance.effect
        return cls.at(run, kind, index, name, axes=axes, factors=2, lines=lines)

    def grid(self) -> FloatArray:
        return self.near(FASTEST)[:, None]

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        return self._at(run.runs.time / self.sample_time, points)

    def entering(self, run: FreeRun, points: FloatArray) -> FloatArray:
        """Return the waves amid each sample, next to their means."""
        return self._at(run.runs.time / self.sample_time + 0.5, points)

    def _at(self, time: FloatArray, points: FloatArray) -> FloatArray:
        angle = _TURN * time[:, None] * points[:, 0]
        return np.stack([np.sin(angle), np.cos(angle)], axis=2)

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        phase = float(np.arctan2(factors[1], factors[0]))
        return SineDisturbance(float(np.hypot(*factors)), self.sample_time / float(point[0]), phase)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ShapedCandidate(LineCandidate):
    """A square or a triangle, by its frequency and where in its cycle it is amid the record.

    Where it begins would follow its frequency: what is searched apart has to be told apart.
    """

    shape: type[SquareDisturbance | TriangleDisturbance]  # the behaviour

    @classmethod
    def of(
        cls,
        run: FreeRun,
        kind: str,
        index: int,
        lines: FloatArray,
        shape: type[SquareDisturbance | TriangleDisturbance],
    ) -> Self:
        """Return the wave as it is searched in a record."""
        axes = (_frequencies(run, SHAPED), Axis(-0.5, 1.0, 3 * PHASES + 1, natural=True))
        return cls.at(run, kind, index, shape.effect, axes=axes, lines=lines, shape=shape)

    @property
    def middle(self) -> float:
        """The middle of the record, samples."""
        return 0.5 * self.length

    def grid(self) -> FloatArray:
        """Return half a turn of phases: a negative amplitude is the other half."""
        meshed = np.meshgrid(self.near(SHAPED), np.arange(PHASES) / (2.0 * PHASES), indexing="ij")
        return np.stack([each.ravel() for each in meshed], axis=1)

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        return self.shape.wave(self._angles(run, points))[:, :, None]

    def entering(self, run: FreeRun, points: FloatArray) -> FloatArray:
        """Return the means over each sample: a square changes sides between samples, too."""
        held = self.shape.held(self._angles(run, points), _TURN * points[None, :, 0])
        return held[:, :, None]

    def _angles(self, run: FreeRun, points: FloatArray) -> FloatArray:
        at = run.runs.time[:, None] / self.sample_time - self.middle
        return np.asarray(_TURN * (at * points[:, 0] + points[:, 1]))

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        size = float(factors[0])
        begun = float(point[1] - self.middle * point[0])
        phase = _TURN * (begun + (0.5 if size < 0.0 else 0.0))
        turned = math.remainder(phase, _TURN)
        return self.shape(abs(size), self.sample_time / float(point[0]), turned)


def _frequencies(run: FreeRun, fastest: float) -> Axis:
    width = 1.0 / (run.runs.longest.stop - run.runs.longest.start)
    return Axis(SLOWEST * width, fastest, 2 * int(fastest / width))


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
    for i in range(gap.shape[1]):
        found += _shapes(run, DISTURBANCE, i, gap[:, [i]], [whitened[i]])
    for j in range(len(run.model.valves)):
        reached = [i for i in range(gap.shape[1]) if run.responses.reaches(i, j)]
        if not reached:
            continue
        for load in _shapes(run, LOAD, j, gap[:, reached], [whitened[i] for i in reached]):
            same = _not_told(run, load, found)
            if same is None:
                found.append(load)
            else:
                found[same] = found[same].or_else(*load.key)
    return found


def _shapes(
    run: FreeRun, kind: str, index: int, gaps: FloatArray, whitened: list[FloatArray]
) -> list[WaveCandidate]:
    """Return every shape at one place, by the gaps of the outputs that it reaches, shape (N, q)."""
    part = run.runs.longest
    values = [v[part] for pair in zip(gaps.T, whitened, strict=True) for v in pair]
    lines = spectral_lines(values, 3.0 / (part.stop - part.start))
    return [
        StepCandidate.of(run, kind, index, surprises(run, whitened)),
        DriftCandidate.at(run, kind, index, DriftDisturbance.effect),
        SineCandidate.of(run, kind, index, lines),
        ShapedCandidate.of(run, kind, index, lines, SquareDisturbance),
        ShapedCandidate.of(run, kind, index, lines, TriangleDisturbance),
    ]


def _not_told(run: FreeRun, load: WaveCandidate, found: list[Candidate]) -> int | None:
    """Return the place of the disturbance that no record tells from a load; None if all do."""
    point = load.values(load.grid()[:1])
    response = load.respond(run, point)
    if load.effect not in ("drift", "sine") or len(response.outputs) != 1:
        return None
    (output,) = response.outputs
    key = f"{DISTURBANCE}:{run.model.outputs[output]}", load.effect
    place, same = next((k, each) for k, each in enumerate(found) if each.key == key)
    seen, wave = run.blocks(output).scored, same.respond(run, point).sizes[output][:, 0]
    own, basis = response.sizes[output][seen, 0], np.hstack([wave, run.free[output]])[seen]
    told = np.sum(left_by(projector(basis), own) ** 2) > TRACE**2 * np.sum(own**2)
    return None if told else place


def surprises(run: FreeRun, innovations: list[FloatArray]) -> FloatArray:
    """Return the moments of the largest innovations, seconds since the first sample.

    Noise with a long memory takes up a step but for the sample at which it comes.
    """
    ranked = [np.argsort(-np.abs(each), kind="stable")[:SURPRISES] for each in innovations]
    return np.concatenate([run.runs.time[rows] for rows in ranked])


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
        for sizes in (power, power / beside):
            sizes[outside] = 0.0
            for _ in range(TRIED):
                peak = int(np.argmax(sizes))
                found.append(float(frequency[peak]))
                sizes[max(peak - 3, 0) : peak + 4] = 0.0
    return np.unique(found)
