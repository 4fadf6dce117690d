"""Roots of A against a circle: whether they lie inside, and pulled inside; compiled."""

from __future__ import annotations

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
