"""Polynomials in the backward shift, monic, constant first: 1 + a_1 q⁻¹ + … ."""

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray


@compiled
def is_stable(a: FloatArray, radius: float) -> bool:
    """Return whether all roots of a monic polynomial lie inside a circle (Schur and Cohn)."""
    order = len(a) - 1
    now, before = np.empty(order + 1), np.empty(order + 1)
    power = 1.0
    for i in range(order + 1):
        now[i] = a[i] / power
        power *= radius
    for size in range(order, 0, -1):
        last = now[size]
        if not abs(last) < 1.0:
            return False
        shrunk = 1.0 - last * last
        for i in range(1, size):
            before[i] = now[i]
        for i in range(1, size):
            now[i] = (before[i] - last * before[size - i]) / shrunk
    return True


@compiled
def pulled_inside(a: FloatArray, radius: float) -> FloatArray:
    """Return A with roots outside ``radius`` pulled back onto it, angles kept."""
    order = len(a) - 1
    if is_stable(a, radius):
        return a
    companion = np.zeros((order, order), dtype=np.complex128)
    for i in range(order):
        companion[0, i] = -a[1 + i]
        if i > 0:
            companion[i, i - 1] = 1.0
    out = np.zeros(order + 1, dtype=np.complex128)
    out[0] = 1.0
    for root in np.linalg.eigvals(companion):
        size = abs(root)
        inside = root * (radius / size) if size > radius else root
        for j in range(order, 0, -1):
            out[j] -= inside * out[j - 1]
    return out.real.copy()


def stabilised(a: FloatArray, radius: float = 0.99) -> FloatArray:
    """Return A with roots outside ``radius`` pulled back onto it, angles kept."""
    return pulled_inside(np.ascontiguousarray(a, dtype=float), radius)


def largest_root(a: FloatArray) -> float:
    """Return the modulus of the largest root of A; 0 where it has none."""
    return float(np.abs(np.roots(a)).max(initial=0.0))


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
