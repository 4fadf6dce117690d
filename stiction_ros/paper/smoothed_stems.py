"""Stems of the smoothed law (5), (6), as the published methods simulate them."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.smoothed_laws import smooth_law

SMOOTHING = 1e4


def final_smoothing(limits: FloatArray) -> FloatArray:
    """Return τ at which (5) equals (4), shape (m,), 1/%: 10⁴, more where OP spans below 10 %.

    Args:
        limits: f_max of every valve, shape (m,), %.
    """
    return np.maximum(SMOOTHING, 10.0 * SMOOTHING / np.maximum(limits, 1e-9))


def smoothed_stems(op: FloatArray, friction: FloatArray, smoothing: FloatArray) -> FloatArray:
    """Return stems of He's smoothed law (5), shape (m, N), %, from rest at the first OP.

    Args:
        op: shape (N, m), %.
        friction: rows (f_S, f_D), shape (m, 2), %; negative ones count as 0, f_S below f_D as f_D.
        smoothing: τ of every valve, shape (m,), 1/%.
    """
    return smooth_law("he").stems(op, friction, smoothing)
