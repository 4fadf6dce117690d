"""Signals that are constant between few samples: stems and switching patterns.

A sticky valve moves at few samples, so its stem is kept as the samples at which it changes and
the values from there on. What costs time then grows with the moves, not with the samples.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects import FrictionLaw, HeStiction
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.friction.grid import simulate
from stiction_ros.identification.kernels.step import dense_steps, he_steps


@dataclasses.dataclass(frozen=True)
class StepSignals:
    """G signals of c channels each."""

    count: int  # N, samples of every signal
    # rows ``offsets[g]`` to ``offsets[g + 1]`` belong to signal g, shape (G + 1,)
    offsets: IntArray
    # samples from which on a row holds; 0 in the first of every signal, shape (R,)
    places: IntArray
    values: FloatArray  # shape (R, c)

    @classmethod
    def of(cls, *channels: FloatArray) -> "StepSignals":
        """Return the signals of which ``channels``, shape (N, G) each, hold all samples."""
        count = len(channels[0])
        rows = np.ascontiguousarray(np.stack(channels).transpose(2, 0, 1), dtype=float)
        return cls(count, *dense_steps(rows))

    @classmethod
    def joined(cls, parts: "list[StepSignals]") -> "StepSignals":
        """Return all signals of several lists, at least one, of equal N and c."""
        offsets, total = [np.zeros(1, dtype=np.int64)], 0
        for part in parts:
            offsets.append(part.offsets[1:] + total)
            total += len(part.places)
        return cls(
            parts[0].count,
            np.concatenate(offsets),
            np.concatenate([part.places for part in parts]),
            np.concatenate([part.values for part in parts]),
        )

    def part(self, begin: int, end: int) -> "StepSignals":
        """Return the signals from ``begin`` to before ``end``."""
        rows = slice(self.offsets[begin], self.offsets[end])
        offsets = self.offsets[begin : end + 1] - self.offsets[begin]
        return StepSignals(self.count, offsets, self.places[rows], self.values[rows])

    def chosen(self, signals: IntArray) -> "StepSignals":
        """Return some of the signals, by their indices."""
        lengths = np.diff(self.offsets)[signals]
        offsets = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(lengths)])
        rows = np.arange(offsets[-1]) + np.repeat(self.offsets[signals] - offsets[:-1], lengths)
        return StepSignals(self.count, offsets, self.places[rows], self.values[rows])

    @property
    def size(self) -> int:
        """G, number of signals."""
        return len(self.offsets) - 1

    @property
    def moves(self) -> IntArray:
        """How often the first channel of each signal changes, shape (G,)."""
        if self.values.shape[1] == 1:  # every row but the first is a change
            return np.diff(self.offsets) - 1
        changed = np.zeros(len(self.places) + 1, dtype=np.int64)
        changed[1:-1] = self.values[1:, 0] != self.values[:-1, 0]
        changed[self.offsets] = 0
        return np.diff(np.cumsum(changed)[self.offsets])


def stem_steps(
    law: type[FrictionLaw],
    grid: FloatArray,
    u: FloatArray,
    start: FloatArray | float,
    further: Sequence[float] = (),
) -> StepSignals:
    """Return stems for rows (f_S, f_D) and OP u, shape (N,), as :func:`simulate` does."""
    if law is not HeStiction:
        return StepSignals.of(simulate(law, grid, u, start, further))
    starts = np.broadcast_to(np.asarray(start, dtype=float), (len(grid),)).copy()
    static, dynamic = np.ascontiguousarray(grid[:, 0]), np.ascontiguousarray(grid[:, 1])
    return StepSignals(len(u), *he_steps(static, dynamic, u, starts))
