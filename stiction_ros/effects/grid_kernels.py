"""Valve and process effects for a whole grid of parameters, compiled.

Every function takes the incoming signal, shape (N,), and one figure per point of the grid and
where it rests, both of shape (G,); it returns outputs of shape (N, G).
"""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray


@compiled
def lagged(share: FloatArray, values: FloatArray, start: FloatArray) -> FloatArray:
    """Return y_k = y_{k−1} + share (x_k − y_{k−1}); no time has passed at the first sample."""
    count, size = len(values), len(share)
    out = np.empty((count, size))
    last = start.copy()
    for k in range(count):
        value = values[k]
        for g in range(size):
            if k > 0:
                moved = last[g] + share[g] * (value - last[g])
                last[g] = value if share[g] == 1.0 else moved
            out[k, g] = last[g]
    return out


@compiled
def leaking(keep: FloatArray, values: FloatArray, start: FloatArray) -> FloatArray:
    """Return y_k = keep y_{k−1} + x_k − x_{k−1}, with y and x at ``start`` before."""
    count, size = len(values), len(keep)
    out = np.empty((count, size))
    last = np.empty(size)
    for k in range(count):
        for g in range(size):
            if k > 0:
                last[g] = keep[g] * last[g] + (values[k] - values[k - 1])
            else:
                last[g] = start[g] + (values[0] - start[g])
            out[k, g] = last[g]
    return out


@compiled
def slewing(reach: FloatArray, values: FloatArray, start: FloatArray) -> FloatArray:
    """Return stems that move by ``reach`` a sample at most, not at all at the first."""
    count, size = len(values), len(reach)
    out = np.empty((count, size))
    stem = start.copy()
    for k in range(count):
        value = values[k]
        for g in range(size):
            if k > 0:
                stem[g] = min(max(value, stem[g] - reach[g]), stem[g] + reach[g])
            out[k, g] = stem[g]
    return out


@compiled
def playing(half: FloatArray, values: FloatArray, start: FloatArray) -> FloatArray:
    """Return stems within ``half`` the play of OP."""
    count, size = len(values), len(half)
    out = np.empty((count, size))
    stem = start.copy()
    for k in range(count):
        value = values[k]
        for g in range(size):
            stem[g] = min(max(stem[g], value - half[g]), value + half[g])
            out[k, g] = stem[g]
    return out


@compiled
def xch_stems(
    static: FloatArray, dynamic: FloatArray, values: FloatArray, start: FloatArray
) -> FloatArray:
    """Return stems of valves (f_S, f_D) that go on moving while OP goes on."""
    count, size = len(values), len(static)
    out = np.empty((count, size))
    stem, direction = start.copy(), np.zeros(size)
    for k in range(count):
        value = values[k]
        for g in range(size):
            last = values[k - 1] if k > 0 else start[g]
            if not direction[g] * (value - last) > 0.0:
                error = value - stem[g]
                slips = np.abs(error) > static[g]
                direction[g] = np.sign(error) if slips else 0.0
            if direction[g] != 0.0:
                stem[g] = value - direction[g] * dynamic[g]
            out[k, g] = stem[g]
    return out


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
