"""Linear processes between samples: stems that are held, dead times, transfer functions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.texts import plural

WHOLE = 1e-9
"""Samples by which a dead time may be off a whole number of them and counts as that."""


class Sampled(NamedTuple):
    """A process at its samples: x⁺ = A x + Σ B_i χ of i samples before, y = C x.

    Attributes:
        a, c: shapes (n, n) and (p, n).
        taps: B_0, B_1, …, shape (d, n, m).
    """

    a: FloatArray
    taps: FloatArray
    c: FloatArray

    def with_past(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A, B and C with the past inputs among the states, behind those there are."""
        d, n, m = self.taps.shape
        size = n + (d - 1) * m
        a, b = np.eye(size, k=-m), np.eye(size, m, -n)
        a[:n], a[n : n + m], b[:n] = np.hstack([self.a, *self.taps[1:]]), 0.0, self.taps[0]
        return a, b, np.pad(self.c, ((0, 0), (0, size - n)))


def held(
    a: FloatArray, b: FloatArray, c: FloatArray, dead_time: float, sample_time: float
) -> Sampled:
    """Return a continuous process at its samples, its inputs held between them.

    Args:
        a, b, c: shapes (n, n), (n, m) and (p, n), time in s.
        dead_time: of all inputs, s, 0 up; it need be no whole number of samples.
        sample_time: s.
    """
    whole = math.floor(dead_time / sample_time + WHOLE)
    part = max(dead_time - whole * sample_time, 0.0)
    late, late_in = _step(a, b, part)
    early, early_in = _step(a, b, sample_time - part)
    taps = np.zeros((whole + 2, *b.shape))
    taps[whole], taps[whole + 1] = early_in, early @ late_in
    return Sampled(early @ late, taps if part > WHOLE * sample_time else taps[:-1], c)


def companion(num: ArrayLike, den: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B and C, shapes (n, n), (n, 1) and (1, n), of a transfer function.

    Args:
        num, den: coefficients, the highest power of s or z first.

    Raises:
        InputError: PV would answer at once.
    """
    above, below = (np.trim_zeros(np.array(each, dtype=float), "f") for each in (num, den))
    n = len(below) - 1
    if len(above) > n:
        said = f"{plural(len(above), 'coefficient')} above and {len(below)} below"
        raise InputError(f"PV answers at once: {said}", fix="give more in the denominator")
    a, c = np.eye(n, k=-1), np.zeros((1, n))
    a[0], c[0, n - len(above) :] = -below[1:] / below[0], above / below[0]
    return a, np.eye(n, 1), c


def beside(channels: Mapping[tuple[int, int], Sampled], outputs: int, inputs: int) -> Sampled:
    """Return one process made of those from an input to an output each.

    Args:
        channels: by index of output and input.
        outputs, inputs: numbers p and m.
    """
    n = sum(len(each.a) for each in channels.values())
    deepest = max((len(each.taps) for each in channels.values()), default=1)
    a, taps, c = np.zeros((n, n)), np.zeros((deepest, n, inputs)), np.zeros((outputs, n))
    first = 0
    for (i, j), each in channels.items():
        rows = slice(first, first + len(each.a))
        a[rows, rows], c[i, rows] = each.a, each.c[0]
        taps[: len(each.taps), rows, j] = each.taps[:, :, 0]
        first += len(each.a)
    return Sampled(a, taps, c)


def _step(a: FloatArray, b: FloatArray, time: float) -> tuple[FloatArray, FloatArray]:
    """Return e^{A t}, and what an input brings that is held for that time, s."""
    from scipy.linalg import expm  # slow to import

    n, m = b.shape
    whole = expm(np.vstack([np.hstack([a, b]), np.zeros((m, n + m))]) * time)
    return whole[:n, :n], whole[:n, n:]
