r"""Waves from outside: a clock that is not the loop's, as part of the model of an output.

A load that swings keeps its time, and PV answers it beside all that comes through the valve:

.. math:: y_k = c + \sum_j \sum_i h^{(j)}_i \chi^{(j)}_{k-i}
          + \sum_{h=1}^{H} (s_h \sin h \omega k + c_h \cos h \omega k) + w_k

A wave that is left out has to be explained by something: by the noise, and by a friction that
happens to move in time with it. A wave that is tried is tried with and without friction alike.
Here ω and H are found, friction left out; each sine costs log n, as in BIC.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.explanation import LINE
from stiction_ros.identification.evidence.fit_problem import NOISE_ORDER, Problem
from stiction_ros.identification.kernels.lags import with_past
from stiction_ros.signals.arx import lagged
from stiction_ros.signals.outside_line import independent
from stiction_ros.signals.spectral_lines import LEAST_PER_HARMONIC, taken_by_lines, taken_by_waves

HARMONICS = 25  # H, at most: corners of a square wave
LEAST_CYCLES = 4.0  # of a wave, in a record
FINE = 8  # frequencies of lines per line width 1 / n
FINER = 8  # fundamentals per frequency of lines: the last harmonic is to be met as well
SHORTEST = 5.0  # rows of a fundamental's period
ZOOMS = (8.0, 1.0, 0.125)  # steps of fundamentals in which the best is looked for ever closer
AROUND = range(-4, 5)  # steps to either side
EXPLAINED = 1e-6  # of the energy: less left than this is none left


@dataclasses.dataclass(frozen=True)
class OutsideWave:
    """A wave in one output."""

    frequency: float  # turns per sample
    harmonics: int  # H
    gain: float  # BIC without minus BIC with it, both without friction

    @property
    def lines(self) -> tuple[float, ...]:
        """Frequencies of all harmonics, turns per sample."""
        return tuple(self.frequency * h for h in range(1, self.harmonics + 1))


def outside_wave(problems: Sequence[Problem], output: int) -> OutsideWave | None:
    """Return the wave that gains most at any rate of one record, None where none is believed."""
    found = [wave for problem in problems if (wave := _strongest(problem, output)) is not None]
    best = max(found, key=lambda wave: wave.gain, default=None)
    return best if best is not None and best.gain > LINE else None


def _strongest(problem: Problem, output: int) -> OutsideWave | None:
    """Return the wave whose harmonics gain most, each that pays for itself counted."""
    beside = _Beside.of(problem, output)
    length = FINE << (beside.count - 1).bit_length()
    slowest = int(np.ceil(LEAST_CYCLES / beside.count * length * FINER))
    fundamentals = np.arange(slowest, int(length * FINER / SHORTEST))
    taken = taken_by_lines(beside.left, beside.plain, length)
    pays = beside.gain(taken) > 2.0 * np.log(beside.count)
    total, last = np.zeros(len(fundamentals)), np.zeros(len(fundamentals), dtype=np.int64)
    for h in range(1, HARMONICS + 1):
        at = (fundamentals * h + FINER // 2) // FINER
        counted = (at < int(length / LEAST_PER_HARMONIC)) & pays[np.minimum(at, len(pays) - 1)]
        total[counted] += taken[at[counted]]
        last[counted] = h
    gains = beside.gain(total) - 2.0 * np.log(beside.count) * last
    best = int(np.argmax(gains)) if len(gains) else 0
    if not len(gains) or gains[best] <= 0.0:
        return None
    harmonics, step = int(last[best]), 1.0 / (length * FINER)
    middle, gain = float(fundamentals[best]) * step, 0.0
    for zoom in ZOOMS:
        tried = [middle + k * zoom * step for k in AROUND]
        gain, middle = max((beside.gain_of_wave(one, harmonics), one) for one in tried)
    return OutsideWave(middle / problem.rate, harmonics, gain)


@dataclasses.dataclass(frozen=True)
class _Beside:
    """What explains an output without any wave, and what it leaves."""

    # orthonormal basis of a constant, the output's past and the valves', shape (n, q)
    plain: FloatArray
    left: FloatArray  # of the output, shape (n,)

    @classmethod
    def of(cls, problem: Problem, output: int) -> "_Beside":
        """Take an output's last samples and all taps of valves that follow OP."""
        y, rows = problem.pv[output], np.arange(problem.first, problem.rows)
        columns = lagged(y, range(1, NOISE_ORDER + 1), problem.first)
        ends = rows + problem.taps
        for stem in problem.ideal_stems():
            sums = np.concatenate([[0.0], np.cumsum(with_past(stem, problem.taps))])
            for low, high in itertools.pairwise(problem.edges):
                columns.append(sums[ends - low] - sums[ends - high])
        plain = independent(np.column_stack(columns))
        return cls(plain, y[rows] - plain @ (plain.T @ y[rows]))

    @property
    def count(self) -> int:
        """n, rows."""
        return len(self.left)

    def gain(self, taken: FloatArray) -> FloatArray:
        """Return −2 log likelihood gained by an energy that is taken, same shape."""
        energy = max(float(self.left @ self.left), 1e-300)
        return np.asarray(-self.count * np.log(np.maximum(1.0 - taken / energy, EXPLAINED)))

    def gain_of_wave(self, frequency: float, harmonics: int) -> float:
        """Return BIC without minus BIC with a wave of a frequency in turns per row."""
        angle = np.asarray(2.0 * np.pi * frequency * np.arange(self.count), dtype=np.float64)
        taken = taken_by_waves(angle, harmonics, self.plain, self.left).sum()
        return float(self.gain(taken) - np.log(self.count) * (1.0 + 2.0 * harmonics))
