"""Stems behind the OP of many runs, compiled."""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray


@compiled
def stems_of(op: FloatArray, friction: FloatArray, start: FloatArray) -> FloatArray:
    """Return the stems by He's law (4), shape (R, n).

    Args:
        op: shape (R, n).
        friction: (f_S, f_D), shape (R, 2).
        start: stems before the first sample, shape (R,).
    """
    stems = np.empty(op.shape)
    for r in range(op.shape[0]):
        stem = start[r]
        for k in range(op.shape[1]):
            apart = op[r, k] - stem
            if apart > friction[r, 0]:
                stem = op[r, k] - friction[r, 1]
            elif apart < -friction[r, 0]:
                stem = op[r, k] + friction[r, 1]
            stems[r, k] = stem
    return stems
