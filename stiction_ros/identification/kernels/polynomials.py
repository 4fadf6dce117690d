"""Polynomials in the backward shift, monic, constant first: 1 + a_1 q⁻¹ + … ."""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.kernels.stability import pulled_inside


def stabilised(a: FloatArray, radius: float = 0.99) -> FloatArray:
    """Return A with roots outside ``radius`` pulled back onto it, angles kept."""
    return pulled_inside(np.ascontiguousarray(a, dtype=float), radius)


def filtered(b: FloatArray, a: FloatArray, values: FloatArray) -> FloatArray:
    """Return ``values``, shape (N,), through B/A from rest; A is monic."""
    length = max(len(a), len(b))
    return _through(_padded(b, length), _padded(a, length), values, np.zeros(length))


def recursion(a: FloatArray, driving: FloatArray, past: FloatArray) -> FloatArray:
    """Return the samples y of A y = ``driving`` after those of the past.

    Args:
        a: A, shape (n + 1,).
        driving: shape (N,).
        past: the last samples before, the latest last, shape (n,).

    Returns:
        Shape (N,); not finite where it overflows.
    """
    latest, order = past[::-1], len(a) - 1
    state = np.array([-np.sum(a[i + 1 :] * latest[: order - i]) for i in range(order)])
    return _through(_padded(np.ones(1), len(a)), a, driving, _padded(state, len(a)))


def _padded(values: FloatArray, length: int) -> FloatArray:
    return np.concatenate([values, np.zeros(length - len(values))])


@compiled
def _through(b: FloatArray, a: FloatArray, values: FloatArray, state: FloatArray) -> FloatArray:
    """Run the transposed direct form; ``state``, which ends with a 0, is overwritten."""
    out = np.empty(len(values))
    for k in range(len(values)):
        now = state[0] + b[0] * values[k]
        out[k] = now
        for i in range(1, len(a)):
            state[i - 1] = state[i] + values[k] * b[i] - now * a[i]
    return out
