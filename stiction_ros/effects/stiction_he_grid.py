"""He's valve for a whole grid of frictions, compiled."""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray


@compiled
def he_stems(
    static: FloatArray, dynamic: FloatArray, u: FloatArray, start: FloatArray
) -> FloatArray:
    """Return stems by (4), shape (N, G), of valves (f_S, f_D) that rest at ``start``, (G,)."""
    count, size = len(u), len(static)
    stems = np.empty((count, size))
    stem = start.copy()
    for k in range(count):
        value = u[k]
        for g in range(size):
            error = value - stem[g]
            up, down = value - dynamic[g], value + dynamic[g]
            moved = up if error > static[g] else (down if error < -static[g] else stem[g])
            stem[g] = moved
            stems[k, g] = moved
    return stems
