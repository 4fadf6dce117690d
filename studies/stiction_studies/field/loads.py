"""What acts on a loop from outside: noise, drifts, waves, set-points, hands."""

import enum

import numpy as np
from scipy.signal import lfilter

from stiction_studies.field.kernels import FlagArray, FloatArray


class Wave(enum.StrEnum):
    """Shape of a periodic signal."""

    SQUARE = "square"
    TRIANGLE = "triangle"
    SINE = "sine"


def wave(shape: Wave, time: FloatArray, period: float, phase: float) -> FloatArray:
    """Return a wave of amplitude 1.

    Args:
        shape: of the wave.
        time: s, shape (K,).
        period: s.
        phase: share of a period at time 0.
    """
    turn = np.mod(time / period + phase, 1.0)
    if shape is Wave.SINE:
        return np.sin(2.0 * np.pi * turn)
    if shape is Wave.SQUARE:
        return np.where(turn < 0.5, 1.0, -1.0)
    return 1.0 - 4.0 * np.abs(turn - 0.5)


def coloured(random: np.random.Generator, count: int, steps: float) -> FloatArray:
    """Return first-order noise of standard deviation 1, shape (count,).

    Args:
        random: source of the noise.
        count: values.
        steps: time constant, in values; 0 is white.
    """
    white = random.standard_normal(count)
    if steps <= 0.0:
        return white
    kept = float(np.exp(-1.0 / steps))
    first = random.standard_normal()
    coming, _ = lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], white, zi=[kept * first])
    return np.asarray(coming)


def held(values: FloatArray, steps: int) -> FloatArray:
    """Return values of which every ``steps``-th is held until the next, same shape."""
    return np.repeat(values[::steps], steps)[: len(values)]


def moves(random: np.random.Generator, count: int, interval: float, regular: bool) -> FloatArray:
    """Return a set-point's moves about 0, each 1 high at most, shape (count,).

    Args:
        random: source of times and sizes.
        count: values.
        interval: between moves, in values.
        regular: whether it goes to and fro in equal times, as a set-point from a swinging
            master does; else times and sizes vary.
    """
    if regular:
        return np.where(np.mod(np.arange(count) / interval, 2.0) < 1.0, 0.5, -0.5)
    path = np.zeros(count)
    at = float(random.uniform(0.2, 1.0)) * interval
    while at < count:
        path[int(at) :] = random.uniform(-0.5, 0.5)
        at += float(random.uniform(0.5, 2.0)) * interval
    return path


def stretch(random: np.random.Generator, count: int) -> FlagArray:
    """Return where a loop is in manual: one stretch of 5 to 20 % of all, shape (count,)."""
    length = int(random.uniform(0.05, 0.2) * count)
    first = int(random.uniform(0.1, 0.75) * count)
    manual = np.zeros(count, dtype=np.bool_)
    manual[first : first + length] = True
    return manual


def hand_moves(random: np.random.Generator, manual: FlagArray, size: float) -> FloatArray:
    """Return how an operator moves OP about where he found it, %, shape (K,)."""
    rows = np.flatnonzero(manual)
    path = np.zeros(len(manual))
    if random.random() < 0.5:
        for row in random.choice(rows, size=3):
            path[row:] += random.uniform(-size, size)
    return path
