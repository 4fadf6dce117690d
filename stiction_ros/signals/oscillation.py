"""Does a signal oscillate, at which period, how regularly and how much?

- *Dominant period* T: the one period at which sine, cosine and a constant, fitted to every
  stretch on its own, explain most (log likelihood for white noise). The first quarter of
  each stretch is left out, as it still settles.
- *Amplitude*: √2 × RMS of the spectral line at T. Each stretch gives its last whole number of
  periods that fits after half a period for settling; sine, cosine and a constant are fitted to
  them, and the squared amplitudes are averaged with the number of samples as weight. A stretch
  too short for one period says nothing. A sticky valve keeps no exact time, and over many cycles
  the line of a cycle that wanders is less than the cycle: stretches are cut into pieces of four
  (:func:`pieces`), unless two runs are compared in which it is the same.
- *Regularity*: mean of the intervals between zero crossings of the autocorrelation over three
  of their standard deviations. Noise averages out in the autocorrelation; a cycle that keeps its
  time leaves even intervals.

References:
    N. F. Thornhill, B. Huang, H. Zhang: Detection of multiple oscillations in control loops.
    J. Process Control 13, 2003, 91-100.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.spectral_lines import fitted_lines, taken_by_lines

Stretches = Sequence[tuple[int, int]]

LEAST_LINE = 0.25  # share of the variance inside the stretches that a cycle explains at least
NEEDED_CYCLES = 4  # whole cycles below which one cannot speak of a cycle
SHORTEST = 6.0  # samples of a period; below that a cycle cannot be told from noise
FINE = 16  # frequencies per line width: a step turns the phase by 1/16 of a cycle over a stretch
FASTEST = 2.0  # samples of a period: what turns at each sample
# zero crossings of the autocorrelation needed, and looked at: later ones are noise
CROSSINGS = 6, 13
NEAR = 1.4  # factor within which the line of a regular oscillation lies from its period
REGULAR = 1.0  # regularity from which on an oscillation is regular
SLOW = 3.0  # periods over which the slow mean is taken
FAST = 8.0  # parts of a period over which noise is averaged out


@dataclasses.dataclass(frozen=True)
class Cycle:
    """The oscillation of a loop."""

    period: float  # dominant period, samples
    share: float  # of the variance inside the stretches that it explains, of the clearest output
    count: int  # whole cycles that this output went through inside the stretches
    output: int  # index of that output


@dataclasses.dataclass(frozen=True)
class Oscillation:
    """How one signal oscillates."""

    period: float  # dominant period, samples
    share: float  # of the variance that the line at this period explains
    count: int  # whole cycles
    regularity: float  # above 1 is regular
    amplitude: float  # √2 × RMS of the line over pieces of four cycles, units of the signal


def oscillation(values: FloatArray, stretches: Stretches) -> Oscillation | None:
    """Return how ``values``, shape (N,), oscillate inside the stretches.

    What is slower than a quarter of the longest stretch is drift and taken out first.

    Returns:
        None when there is no room for four cycles, or nothing moves.
    """
    longest = max((b - a for a, b in stretches), default=0)
    if longest < NEEDED_CYCLES * SHORTEST:
        return None
    slowest = longest / NEEDED_CYCLES
    level = values.copy()
    for first, last in stretches:
        level[first:last] -= slow_mean(values[first:last], slowest)
    first, last = max(stretches, key=lambda stretch: stretch[1] - stretch[0])
    regular, period = regularity(level[first:last])
    periods = (SHORTEST, slowest)
    period = max(period, FASTEST)
    if regular > REGULAR and period < slowest:
        periods = (max(period / NEAR, FASTEST), min(period * NEAR, slowest))
    cycle = dominant_cycle(level[:, None], stretches, periods)
    if cycle is None:
        return None
    size = amplitude(level, pieces(stretches, cycle.period), cycle.period)
    return Oscillation(
        cycle.period, cycle.share, cycle.count, regular, 0.0 if size is None else size
    )


def dominant_cycle(
    error: FloatArray, stretches: Stretches, periods: tuple[float, float] | None = None
) -> Cycle | None:
    """Return the oscillation that explains the errors inside the stretches best.

    Args:
        error: PV − SP, shape (N, p).
        stretches: the holds.
        periods: shortest and longest looked for, samples, none below :data:`FASTEST`; None for
            all up to the longest hold.

    Returns:
        None when no hold has room for one period, or nothing moves at all.
    """
    settled = [(a + (b - a) // 4, b) for a, b in stretches]
    longest = max(b - a for a, b in settled)
    settled = [(a, b) for a, b in settled if b - a >= longest / 3]
    total = np.array([sum(_energy(error[a:b, j]) for a, b in settled) for j in _columns(error)])
    if longest < 2 * SHORTEST or not np.any(total > 0):
        return None
    count = sum(b - a for a, b in settled)
    shortest, slowest = periods or (SHORTEST, float(longest))
    least = max(FINE, int(np.ceil(FINE * longest / slowest)))
    bins = np.arange(least, int(np.ceil(FINE * longest / max(shortest, FASTEST))))
    if not len(bins):
        return None
    frequencies = bins / (FINE * longest)
    shares = _explained(error, settled, bins, FINE * longest) / np.maximum(total, 1e-300)
    gains = -0.5 * count * np.log(np.maximum(1.0 - shares, 1e-12)).sum(axis=1)
    best = int(np.argmax(gains))
    period = float(1 / frequencies[best])
    output = int(np.argmax(shares[best]))
    swings = _count_swings(error[:, output], stretches, settled, period)
    return Cycle(period, float(shares[best, output]), swings, output)


def amplitude(error: FloatArray, stretches: Stretches, period: float) -> float | None:
    """Return √2 × RMS of the spectral line of ``error``, shape (N,), at ``period`` samples."""
    squares = weight = 0.0
    for first, last in stretches:
        room = last - first - period / 2
        count = round(np.floor(room / period + 1e-9) * period)
        if count < period / 2 or count < 4:
            continue
        fitted, _ = fitted_lines(error[last - count : last], period)
        squares += count * float(fitted[1] ** 2 + fitted[2] ** 2)
        weight += count
    return float(np.sqrt(squares / weight)) if weight else None


def pieces(stretches: Stretches, period: float) -> list[tuple[int, int]]:
    """Return stretches cut into pieces of four periods, each with the half before it.

    What is left of a stretch at its start is a piece of its own.

    Args:
        stretches: to cut, samples.
        period: samples.
    """
    found, whole = [], NEEDED_CYCLES * period
    for first, last in stretches:
        for end in np.arange(last, first, -whole):
            found.append((max(first, round(end - whole - 0.5 * period)), round(end)))
    return found


def regularity(values: FloatArray) -> tuple[float, float]:
    """Return regularity and period, samples, by the autocorrelation of ``values``, shape (N,).

    Returns:
        Zeros where the first half of the lags has fewer than six zero crossings.
    """
    count = len(values)
    row = np.arange(count) - 0.5 * (count - 1)
    level = values - values.mean()
    level = level - row * float(row @ level) / max(float(row @ row), 1e-300)
    length = 1 << (2 * count - 1).bit_length()
    power = np.abs(np.fft.rfft(level, length)) ** 2
    correlation = np.fft.irfft(power, length)[: count // 2]
    crossings = np.flatnonzero(np.diff(np.signbit(correlation)))[: CROSSINGS[1]]
    if len(crossings) < CROSSINGS[0]:
        return 0.0, 0.0
    before, after = correlation[crossings], correlation[crossings + 1]
    intervals = np.diff(crossings + before / (before - after))
    mean = float(intervals.mean())
    return mean / (3.0 * max(float(intervals.std(ddof=1)), 1e-3 * mean)), 2.0 * mean


def turnings(values: FloatArray, level: float) -> NDArray[np.intp]:
    """Return the samples that are the first beyond a level on the other side than before, (T,).

    Args:
        values: shape (N,).
        level: 0 or more, to either side of 0.
    """
    beyond = np.flatnonzero(np.abs(values) > level)
    return beyond[1:][np.diff(np.signbit(values[beyond]))]


def slow_mean(values: FloatArray, width: float) -> FloatArray:
    """Return the running mean of ``values``, shape (N,), over about ``width`` samples.

    Where the window does not fit, at both ends, the nearest mean is held.
    """
    count = len(values)
    half = max(int(width / 2), 1)
    if count <= 2 * half + 1:
        return np.full(count, float(values.mean()))
    sums = np.concatenate([[0.0], np.cumsum(values - values[0])])
    middle = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1) + values[0]
    return np.concatenate([np.full(half, middle[0]), middle, np.full(half, middle[-1])])


def _columns(error: FloatArray) -> range:
    return range(error.shape[1])


def _energy(values: FloatArray) -> float:
    return float(((values - values.mean()) ** 2).sum())


def _explained(
    error: FloatArray, stretches: Stretches, bins: NDArray[np.intp], n: int
) -> FloatArray:
    """Return the energy, shape (F, p), that a line at each frequency takes out of the holds.

    Args:
        bins: frequencies times n, shape (F,).
        n: even, at least the length of every stretch.
    """
    taken = np.zeros((len(bins), error.shape[1]))
    for first, last in stretches:
        count = last - first
        level, room = np.full((count, 1), count**-0.5), bins * count >= n  # one period at least
        for j in _columns(error):
            values = error[first:last, j] - error[first:last, j].mean()
            taken[room, j] += taken_by_lines(values, level, n)[bins[room]]
    return taken


def _count_swings(
    values: FloatArray, stretches: Stretches, settled: Stretches, period: float
) -> int:
    """Return how many whole cycles ``values`` go through inside the holds.

    A half cycle ends where the error, smoothed over an eighth of a period, crosses from
    beyond half the RMS of the settled parts on one side of their mean to beyond it on the
    other. A hold in which the valve rests adds none.
    """
    width = max(int(period / 8), 1)
    smooth = np.convolve(values, np.ones(width) / width, mode="same")
    means = [float(smooth[a:b].mean()) for a, b in settled]
    energy = sum(_energy(smooth[a:b]) for a, b in settled)
    level = 0.5 * float(np.sqrt(energy / sum(b - a for a, b in settled)))
    by_end = {b: mean for (_, b), mean in zip(settled, means, strict=True)}
    halves = 0
    for first, last in stretches:
        if last not in by_end:
            continue
        part = smooth[first + round(period / 4) : last] - by_end[last]
        turns = len(turnings(part, level))
        halves += turns + 1 if turns else 0
    return halves // 2


def moving(values: FloatArray, period: float) -> FloatArray:
    """Return ``values``, shape (N,), about their slow mean and without their fast noise."""
    fast = slow_mean(values, period / FAST) if period >= 2 * FAST else values
    return fast - slow_mean(values, SLOW * period)


def size(moved: FloatArray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(moved**2)))
