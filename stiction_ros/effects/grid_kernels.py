"""Valve and process effects for a whole grid of parameters, compiled.

Every function takes the incoming signal, shape (N,), and one figure per point of the grid and
where it rests, both of shape (G,); it returns outputs of shape (N, G).
"""

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.seen import FloatArray


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
def following_stems(
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
def slope_step(memory: FloatArray, value: float, dynamic: float, band: float, jump: float) -> None:
    """Move a valve (S, J), its f_D given, by Choudhury's rules, by a sample of OP.

    The memory is χ, u, v, x_ss and both thresholds, below 0 while the valve moves.
    """
    slope, before = np.sign(value - memory[1]), memory[2]
    if slope != before:
        if memory[4] < 0.0:
            memory[3] = memory[1]
            memory[4] = jump if slope == 0.0 and before > 0.0 else band
            memory[5] = jump if slope == 0.0 and before < 0.0 else band
    elif slope != 0.0 and abs(value - memory[3]) > (memory[4] if slope > 0.0 else memory[5]):
        memory[0] = value - slope * dynamic
        memory[4], memory[5] = -1.0, -1.0
    memory[1], memory[2] = value, slope


@compiled
def choudhury_stems(
    band: FloatArray, jump: FloatArray, values: FloatArray, start: FloatArray
) -> FloatArray:
    """Return stems of valves (S, J) by Choudhury's rules."""
    out = np.empty((len(values), len(band)))
    for g in range(len(band)):
        static, dynamic = (band[g] + jump[g]) / 2.0, (band[g] - jump[g]) / 2.0
        memory = np.array([start[g], start[g], 0.0, start[g], static, static])
        for k in range(len(values)):
            slope_step(memory, values[k], dynamic, band[g], jump[g])
            out[k, g] = memory[0]
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


@compiled
def semi_physical_stems(
    static: FloatArray, dynamic: FloatArray, overshoot: FloatArray, u: FloatArray, start: FloatArray
) -> FloatArray:
    """Return stems, shape (N, G), of valves (f_S, f_D, K) that rest at ``start``, (G,)."""
    count, size = len(u), len(static)
    stems = np.empty((count, size))
    stem = start.copy()
    for k in range(count):
        for g in range(size):
            error = u[k] - stem[g]
            if abs(error) > static[g]:
                friction = dynamic[g] if error > 0.0 else -dynamic[g]
                stem[g] += overshoot[g] * (error - friction)
            stems[k, g] = stem[g]
    return stems
