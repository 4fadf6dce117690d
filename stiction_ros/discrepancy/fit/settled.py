"""Figures in which a response is a straight line, at their best for every point of a grid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.fit.misfit import misfit
from stiction_ros.effects import FloatArray

if TYPE_CHECKING:
    from stiction_ros.discrepancy.fit.baseline import Baseline

PROBE = 0.05  # of a linear axis, at which its parabola is taken
_TINY = 1e-300


def settled(
    base: Baseline,
    gap: FloatArray,
    candidate: Candidate,
    coordinates: FloatArray,
    ar: Mapping[int, FloatArray],
) -> FloatArray:
    """Return points with their linear figures at their best under given φ, shape (G, axes)."""
    moved = coordinates.copy()
    for d, axis in enumerate(candidate.axes):
        if not axis.linear:
            continue
        scores = []
        for side in (-1.0, 0.0, 1.0):
            moved[:, d] = side * PROBE * axis.high
            response = candidate.respond(base.run, candidate.values(moved))
            scores.append(misfit(base, gap, response, ar))
        kept = np.isfinite(scores).all(axis=0)  # elsewhere a side is no figure of the effect
        scores = [np.where(kept, score, 0.0) for score in scores]
        rows = sum(int(base.blocks[i].train.sum()) for i in response.outputs)
        low, middle, high = np.exp((np.array(scores) - np.min(scores, axis=0)) / max(rows, 1))
        bend = np.maximum(low - 2.0 * middle + high, _TINY)
        vertex = np.clip(0.5 * PROBE * (low - high), -bend, bend) / bend
        moved[:, d] = np.where(kept, vertex * axis.high, coordinates[:, d])
    return moved
