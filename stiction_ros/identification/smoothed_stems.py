"""Stems of the smoothed law (5), (6), as the published methods simulate them."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.stiction_he_smoothed import SmoothedHeStiction

SMOOTHING = 1e4


def final_smoothing(limits: FloatArray) -> FloatArray:
    """Return τ at which (5) equals (4), shape (m,), 1/%: 10⁴, more where OP spans below 10 %.

    Args:
        limits: f_max of every valve, shape (m,), %.
    """
    return np.maximum(SMOOTHING, 10.0 * SMOOTHING / np.maximum(limits, 1e-9))


def smoothed_stems(op: FloatArray, friction: FloatArray, smoothing: FloatArray) -> FloatArray:
    """Return stems of the smoothed law (5), shape (m, N), %, from rest at the first OP.

    Args:
        op: shape (N, m), %.
        friction: rows (f_S, f_D), shape (m, 2), %.
        smoothing: τ of every valve, shape (m,), 1/%.
    """
    stems = []
    for u, (static, dynamic), tau in zip(op.T, friction.tolist(), smoothing.tolist(), strict=True):
        static, dynamic = max(static, 0.0), max(dynamic, 0.0)
        law = SmoothedHeStiction(max(static, dynamic), dynamic, tau)
        stems.append(law.simulate(u, float(u[0])))
    return np.array(stems)
