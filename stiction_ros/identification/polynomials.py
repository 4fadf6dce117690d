"""Polynomials in the backward shift, monic, constant first: 1 + a_1 q⁻¹ + … ."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


def stabilised(a: FloatArray, radius: float = 0.99) -> FloatArray:
    """Return A with roots outside ``radius`` pulled back onto it, angles kept."""
    order = len(a) - 1
    if order == 0:
        return a
    companion = np.eye(order, k=-1)
    companion[0] = -a[1:]
    roots = np.linalg.eigvals(companion)
    size = np.abs(roots)
    if size.max() <= radius:
        return a
    roots = np.where(size > radius, roots / np.maximum(size, 1e-12) * radius, roots)
    out = np.zeros(order + 1, dtype=complex)
    out[0] = 1.0
    for i in range(order):
        out[1 : i + 2] -= roots[i] * out[: i + 1]
    return np.ascontiguousarray(out.real)
