"""Switching patterns of He's valve for whole grids of frictions, and their cells.

All arrays are time-major, so that the inner loops run over the grid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray


@compiled
def he_patterns(
    u: FloatArray,
    jump: FloatArray,
    reverse: FloatArray,
    level: FloatArray,
    first: int,
    direction: float,
) -> tuple[FloatArray, FloatArray]:
    """Return u at the last slip and its direction, both of shape (N, G).

    Args:
        jump, reverse: J and S, %, shape (G,).
        level: stem before the first slip, %, shape (G,).
        first: sample of the first slip; −1 when J and S decide it as well.
        direction: of the first slip.
    """
    count, size = len(u), len(jump)
    bases, signs = np.empty((count, size)), np.empty((count, size))
    base, sign = level.copy(), np.zeros(size)
    half = 0.5 * (jump + reverse)
    high, low = level + half, level - half
    for k in range(count):
        value = u[k]
        if k == first:
            for g in range(size):
                base[g], sign[g] = value, direction
                high[g] = value + (jump[g] if direction > 0.0 else reverse[g])
                low[g] = value - (reverse[g] if direction > 0.0 else jump[g])
        elif k > first:
            for g in range(size):
                up, down = value > high[g], value < low[g]
                high[g] = value + jump[g] if up else (value + reverse[g] if down else high[g])
                low[g] = value - reverse[g] if up else (value - jump[g] if down else low[g])
                sign[g] = 1.0 if up else (-1.0 if down else sign[g])
                base[g] = value if up | down else base[g]
        for g in range(size):
            bases[k, g] = base[g]
            signs[k, g] = sign[g]
    return bases, signs


@compiled
def cell_bounds(u: FloatArray, bases: FloatArray, signs: FloatArray) -> FloatArray:
    """Return what stays and slips of patterns say of J and S, shape (G, 4).

    Rows (J low, J high, S low, S high), %.
    """
    count, size = bases.shape
    bounds = np.empty((4, size))
    bounds[0], bounds[1], bounds[2], bounds[3] = 0.0, np.inf, 0.0, np.inf
    for k in range(1, count):
        value = u[k]
        for g in range(size):
            lead = signs[k - 1, g] * (value - bases[k - 1, g])
            slips = bases[k, g] != bases[k - 1, g]
            on, back = (lead, -lead) if slips else (np.inf, np.inf)
            on, back = on if lead > 0.0 else np.inf, back if lead < 0.0 else np.inf
            stays = 0.0 if slips else lead
            bounds[0, g] = max(bounds[0, g], stays)
            bounds[1, g] = min(bounds[1, g], on)
            bounds[2, g] = max(bounds[2, g], -stays)
            bounds[3, g] = min(bounds[3, g], back)
    return bounds.T.copy()


@compiled
def count_moves(stems: FloatArray) -> NDArray[np.int64]:
    """Return how often each stem of shape (N, G) moved, shape (G,)."""
    count, size = stems.shape
    moves = np.zeros(size, dtype=np.int64)
    for k in range(1, count):
        for g in range(size):
            moves[g] += stems[k, g] != stems[k - 1, g]
    return moves
