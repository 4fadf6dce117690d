"""Polynomials in the backward shift, monic, constant first: 1 + a_1 q⁻¹ + … ."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.kernels.stability import pulled_inside


def stabilised(a: FloatArray, radius: float = 0.99) -> FloatArray:
    """Return A with roots outside ``radius`` pulled back onto it, angles kept."""
    return pulled_inside(np.ascontiguousarray(a, dtype=float), radius)
