"""Polynomials in the backward shift, monic, constant first: 1 + a_1 q⁻¹ + … ."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


def stabilised(a: FloatArray, radius: float = 0.99) -> FloatArray:
    """Return A with roots outside ``radius`` pulled back onto it, angles kept."""
    roots = np.roots(a)
    size = np.abs(roots)
    if not len(roots) or size.max() <= radius:
        return a
    roots = np.where(size > radius, roots / np.maximum(size, 1e-12) * radius, roots)
    return np.real(np.poly(roots))
