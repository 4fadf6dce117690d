"""Shapes in time that a disturbance may have, as candidates search them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

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
_TURN = 2.0 * math.pi


class Wave(ABC):
    """A shape in time.

    Attributes:
        effect: as loop models name it.
        axes: of the figures that are searched.
        factors: number of figures that least squares finds.
        dated: whether its first axis is a moment of the record.
    """

    effect: str
    axes: tuple[Axis, ...] = ()
    factors: int = 1
    dated: bool = False

    @abstractmethod
    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        """Return the waves of size one, shape (N, G, factors), for points (G, axes)."""

    @abstractmethod
    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        """Return the disturbance with these figures."""

    def grid(self) -> FloatArray:
        """Return the first grid in coordinates of the search, shape (G, axes)."""
        return np.zeros((1, 0))


class StepWave(Wave):
    """A step at one moment."""

    effect = "step"
    dated = True

    def __init__(self, run: FreeRun, moments: FloatArray) -> None:
        """Take moments, seconds, at which PV surprises most."""
        self._step, last = run.runs.sample_time, float(run.runs.time.max())
        self._moments = moments
        self.axes = (Axis(0.02 * last, 0.98 * last, 60, natural=True),)

    def grid(self) -> FloatArray:
        axis = self.axes[0]
        moments = np.clip(self._moments, axis.low, axis.high)
        return np.unique(np.concatenate([axis.grid(), moments]))[:, None]

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        late = run.runs.time[:, None] >= points[:, 0] - 1e-9
        return late.astype(float)[:, :, None]

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        onset = float(np.ceil(point[0] / self._step - 1e-9)) * self._step
        return StepDisturbance(onset, float(factors[0]))


class DriftWave(Wave):
    """A ramp from the first sample on."""

    effect = "drift"

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        return run.runs.time[:, None, None]

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        return DriftDisturbance(float(factors[0]))


class SineWave(Wave):
    """A sine, searched near the lines of the gap's own spectrum."""

    effect = "sine"
    factors = 2

    def __init__(self, run: FreeRun, lines: FloatArray) -> None:
        """Take cycles per sample at which the gap has lines."""
        rows = run.runs.longest
        self._bin = 1.0 / (rows.stop - rows.start)
        self._step, self._lines = run.runs.sample_time, lines
        self.axes = (_frequencies(self._bin),)

    def grid(self) -> FloatArray:
        return _near(self._lines, self._bin)[:, None]

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        angle = _TURN * (run.runs.time[:, None] / self._step) * points[:, 0]
        return np.stack([np.sin(angle), np.cos(angle)], axis=2)

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        phase = float(np.arctan2(factors[1], factors[0]))
        return SineDisturbance(float(np.hypot(*factors)), self._step / float(point[0]), phase)


class ShapedWave(Wave):
    """A square or a triangle, by its frequency and where in its cycle it is amid the record.

    Where it begins would follow its frequency: what is searched apart has to be told apart.
    """

    def __init__(
        self,
        run: FreeRun,
        lines: FloatArray,
        kind: type[SquareDisturbance | TriangleDisturbance],
    ) -> None:
        """Take cycles per sample at which the gap has lines, and the behaviour."""
        rows = run.runs.longest
        self._bin = 1.0 / (rows.stop - rows.start)
        self._step, self._lines, self._kind = run.runs.sample_time, lines, kind
        self._middle = 0.5 * (rows.stop - rows.start)
        self.effect = kind.effect
        self.axes = (_frequencies(self._bin, SHAPED), Axis(-0.5, 1.0, 3 * PHASES + 1, natural=True))

    def grid(self) -> FloatArray:
        """Return half a turn of phases: a negative amplitude is the other half."""
        lines, phases = _near(self._lines, self._bin, SHAPED), np.arange(PHASES) / (2.0 * PHASES)
        meshed = np.meshgrid(lines, phases, indexing="ij")
        return np.stack([each.ravel() for each in meshed], axis=1)

    def columns(self, run: FreeRun, points: FloatArray) -> FloatArray:
        turns = (run.runs.time[:, None] / self._step - self._middle) * points[:, 0] + points[:, 1]
        return self._kind.wave(_TURN * turns)[:, :, None]

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        size = float(factors[0])
        begun = float(point[1] - self._middle * point[0])
        phase = _TURN * (begun + (0.5 if size < 0.0 else 0.0))
        turned = math.remainder(phase, _TURN)
        return self._kind(abs(size), self._step / float(point[0]), turned)


def _frequencies(width: float, fastest: float = FASTEST) -> Axis:
    return Axis(SLOWEST * width, fastest, 2 * int(fastest / width))


def _near(lines: FloatArray, width: float, fastest: float = FASTEST) -> FloatArray:
    """Return frequencies on and beside the lines, shape (K,)."""
    low, high = SLOWEST * width, fastest
    return np.unique(np.clip(lines[:, None] + np.array(BESIDE) * width, low, high))
