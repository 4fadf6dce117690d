"""Delays in whole and broken samples: of the process, and of a signal in its record."""

import dataclasses
import math

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, Filter, FloatArray, Memory, Start, starts

LONGEST = 1000.0


@dataclasses.dataclass(frozen=True)
class Delay(Behaviour):
    r"""y_k = (1 − f) x_{k−n} + f x_{k−n−1} for a delay of n + f samples, 0 ≤ f < 1.

    The memory holds the last samples of x, the newest first.
    """

    @property
    def samples(self) -> float:
        return float(getattr(self, self.parameters()[0].attribute))

    def rest(self, value: float) -> Memory:
        return (value,) * math.ceil(self.samples)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        line = (value, *memory)
        whole, rest = int(self.samples), self.samples % 1.0
        out = line[whole] if rest == 0.0 else (1.0 - rest) * line[whole] + rest * line[whole + 1]
        return line[: len(memory)], out

    @classmethod
    def simulate_grid(
        cls, grid: FloatArray, values: FloatArray, start: Start, sample_time: float = 1.0
    ) -> FloatArray:
        rows = zip(grid[:, 0].tolist(), starts(start, len(grid)).tolist(), strict=True)
        return np.stack([_delayed(values, delay, at) for delay, at in rows], axis=1)

    def filter(self, sample_time: float) -> Filter:
        """Return the line of past samples, the newest first."""
        whole, rest = int(self.samples), self.samples % 1.0
        count = math.ceil(self.samples)
        taps = np.zeros(count + 1)
        taps[whole] += 1.0 - rest
        if rest > 0.0:
            taps[whole + 1] += rest
        first = np.zeros(count)
        first[:1] = 1.0
        return Filter(np.eye(count, k=-1), first, taps[1:], float(taps[0]))


def _delayed(values: FloatArray, delay: float, start: float) -> FloatArray:
    whole, rest = int(delay), delay % 1.0
    padded = np.concatenate([np.full(whole + 1, start), values])
    count = len(values)
    if rest == 0.0:
        return padded[1 : count + 1]
    return np.asarray((1.0 - rest) * padded[1 : count + 1] + rest * padded[:count])
