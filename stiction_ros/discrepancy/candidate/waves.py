"""Shapes in time that a disturbance may have, as candidates search them."""

import dataclasses
import math
from abc import ABC, abstractmethod
from typing import Self

import numpy as np

from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import (
    Axis,
    Behaviour,
    DriftDisturbance,
    FloatArray,
    SineDisturbance,
    SquareDisturbance,
    StepDisturbance,
    TriangleDisturbance,
)

FASTEST = 0.45  # cycles per sample
SHAPED = FASTEST / 3.0  # of a square or a triangle: its third harmonic has to be seen
SLOWEST = 2.0  # cycles in the longest record
BESIDE = (-0.5, -0.25, 0.0, 0.25, 0.5)  # of the width of a spectral line
PHASES = 8
A_FREQUENCY = 3
"""Figures that a frequency counts as: what n samples tell of it grows with n³, of others with n
(P. M. Djurić, A model selection rule for sinusoids in white Gaussian noise, IEEE Transactions on
Signal Processing 44, 1996)."""
_TURN = 2.0 * math.pi


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Wave(ABC):
    """A shape in time."""

    effect: str  # as loop models name it
    axes: tuple[Axis, ...] = ()  # of the figures that are searched
    factors: int = 1  # number of figures that least squares finds
    dated: bool = False  # whether its first axis is a moment of the record
    further: int = 0  # figures that it counts as for BIC, beyond those that it has

    @abstractmethod
    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        """Return the waves of size one, shape (N, G, factors), for points (G, axes)."""

    def entering(self, run: FreeRun, points: FloatArray) -> FloatArray:
        """Return what of the waves enters a process, as :meth:`columns` returns them."""
        return self.columns(run, points)

    @abstractmethod
    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        """Return the disturbance with these figures."""

    def grid(self) -> FloatArray:
        """Return the first grid in coordinates of the search, shape (G, axes)."""
        return np.zeros((1, 0))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class StepWave(Wave):
    """A step at one moment."""

    effect: str = StepDisturbance.effect
    dated: bool = True
    sample_time: float  # s
    moments: FloatArray  # at which PV surprises most, s

    @classmethod
    def of(cls, run: FreeRun, moments: FloatArray) -> Self:
        """Return the step as it is searched in a record."""
        last = float(run.runs.time.max())
        axes = (Axis(0.02 * last, 0.98 * last, 60, natural=True),)
        return cls(axes=axes, sample_time=run.runs.sample_time, moments=moments)

    def grid(self) -> FloatArray:
        axis = self.axes[0]
        moments = np.clip(self.moments, axis.low, axis.high)
        return np.unique(np.concatenate([axis.grid(), moments]))[:, None]

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        late = run.runs.time[:, None] >= points[:, 0] - 1e-9
        return late.astype(float)[:, :, None]

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        onset = float(np.ceil(point[0] / self.sample_time - 1e-9)) * self.sample_time
        return StepDisturbance(onset, float(factors[0]))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class DriftWave(Wave):
    """A ramp from the first sample on."""

    effect: str = DriftDisturbance.effect

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        return run.runs.time[:, None, None]

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        return DriftDisturbance(float(factors[0]))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class LineWave(Wave):
    """A wave that is searched near the lines of the gap's own spectrum."""

    further: int = A_FREQUENCY - 1
    sample_time: float  # s
    length: int  # of the longest record, samples
    lines: FloatArray  # of the gap, cycles per sample

    @property
    def width(self) -> float:
        """Width of a line, cycles per sample."""
        return 1.0 / self.length


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SineWave(LineWave):
    """A sine."""

    effect: str = SineDisturbance.effect
    factors: int = 2

    @classmethod
    def of(cls, run: FreeRun, lines: FloatArray) -> Self:
        """Return the sine as it is searched in a record."""
        length = run.runs.longest.stop - run.runs.longest.start
        return cls(
            axes=(_frequencies(1.0 / length),),
            sample_time=run.runs.sample_time,
            length=length,
            lines=lines,
        )

    def grid(self) -> FloatArray:
        return _near(self.lines, self.width)[:, None]

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
class ShapedWave(LineWave):
    """A square or a triangle, by its frequency and where in its cycle it is amid the record.

    Where it begins would follow its frequency: what is searched apart has to be told apart.
    """

    kind: type[SquareDisturbance | TriangleDisturbance]  # the behaviour

    @classmethod
    def of(
        cls, run: FreeRun, lines: FloatArray, kind: type[SquareDisturbance | TriangleDisturbance]
    ) -> Self:
        """Return the wave as it is searched in a record."""
        length = run.runs.longest.stop - run.runs.longest.start
        phases = Axis(-0.5, 1.0, 3 * PHASES + 1, natural=True)
        return cls(
            effect=kind.effect,
            axes=(_frequencies(1.0 / length, SHAPED), phases),
            sample_time=run.runs.sample_time,
            length=length,
            lines=lines,
            kind=kind,
        )

    @property
    def middle(self) -> float:
        """The middle of the record, samples."""
        return 0.5 * self.length

    def grid(self) -> FloatArray:
        """Return half a turn of phases: a negative amplitude is the other half."""
        lines, phases = _near(self.lines, self.width, SHAPED), np.arange(PHASES) / (2.0 * PHASES)
        meshed = np.meshgrid(lines, phases, indexing="ij")
        return np.stack([each.ravel() for each in meshed], axis=1)

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        return self.kind.wave(self._angles(run, points))[:, :, None]

    def entering(self, run: FreeRun, points: FloatArray) -> FloatArray:
        """Return the means over each sample: a square changes sides between samples, too."""
        held = self.kind.held(self._angles(run, points), _TURN * points[None, :, 0])
        return held[:, :, None]

    def _angles(self, run: FreeRun, points: FloatArray) -> FloatArray:
        at = run.runs.time[:, None] / self.sample_time - self.middle
        return np.asarray(_TURN * (at * points[:, 0] + points[:, 1]))

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        size = float(factors[0])
        begun = float(point[1] - self.middle * point[0])
        phase = _TURN * (begun + (0.5 if size < 0.0 else 0.0))
        turned = math.remainder(phase, _TURN)
        return self.kind(abs(size), self.sample_time / float(point[0]), turned)


def _frequencies(width: float, fastest: float = FASTEST) -> Axis:
    return Axis(SLOWEST * width, fastest, 2 * int(fastest / width))


def _near(lines: FloatArray, width: float, fastest: float = FASTEST) -> FloatArray:
    """Return frequencies on and beside the lines, shape (K,)."""
    low, high = SLOWEST * width, fastest
    return np.unique(np.clip(lines[:, None] + np.array(BESIDE) * width, low, high))
