"""Roots of A against a circle: whether they lie inside, and pulled inside; compiled."""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray

ROUNDS = 500
CLOSE = 1e-13


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
    """Return A with roots outside ``radius`` pulled back onto it, angles kept.

    The roots come from the simultaneous iteration of Durand and Kerner.
    """
    order = len(a) - 1
    if is_stable(a, radius):
        return a
    roots = np.empty(order, dtype=np.complex128)
    for i in range(order):
        roots[i] = (0.4 + 0.9j) ** i
    for _ in range(ROUNDS):
        largest = 0.0
        for i in range(order):
            value, apart = roots[i] + a[1], 1.0 + 0.0j
            for j in range(2, order + 1):
                value = value * roots[i] + a[j]
            for j in range(order):
                if j != i:
                    apart *= roots[i] - roots[j]
            change = value / apart
            roots[i] -= change
            largest = max(largest, abs(change))
        if largest < CLOSE:
            break
    out = np.zeros(order + 1, dtype=np.complex128)
    out[0] = 1.0
    for i in range(order):
        size = abs(roots[i])
        if size > radius:
            roots[i] *= radius / size
        for j in range(i + 1, 0, -1):
            out[j] -= roots[i] * out[j - 1]
    return out.real.copy()
