"""He's valve and its switching patterns as lists of moves, compiled.

Between two moves OP stays in a band. Whole blocks of samples inside it are passed over by the
extremes of OP in them.
"""

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray, IntArray

BLOCK = 8
MANY = 8  # blocks that are passed over at once where OP stays in the band
SPARE = 24  # rows per signal for which there is room at first


@compiled
def _extremes(highest: FloatArray, lowest: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
    """Return the highest and the lowest value of every ``size`` in a row."""
    blocks = (len(highest) + size - 1) // size
    highs, lows = np.empty(blocks), np.empty(blocks)
    for b in range(blocks):
        high, low = highest[b * size], lowest[b * size]
        for k in range(b * size + 1, min((b + 1) * size, len(highest))):
            high, low = max(high, highest[k]), min(low, lowest[k])
        highs[b], lows[b] = high, low
    return highs, lows


@compiled
def _with_room(
    places: IntArray, values: FloatArray, total: int, more: int
) -> tuple[IntArray, FloatArray]:
    """Return both with room for ``more`` rows behind ``total``."""
    if total + more <= len(places):
        return places, values
    size = 2 * len(places) + more
    wider, higher = np.empty(size, dtype=np.int64), np.empty((size, values.shape[1]))
    for row in range(total):
        wider[row] = places[row]
        for c in range(values.shape[1]):
            higher[row, c] = values[row, c]
    return wider, higher


@compiled
def he_steps(
    static: FloatArray, dynamic: FloatArray, u: FloatArray, start: FloatArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return offsets, places and values of stems by (4) of valves that rest at ``start``.

    Args:
        static, dynamic, start: f_S, f_D and the stem before the first sample, %, shape (G,).
        u: OP, %, shape (N,).
    """
    count, size = len(u), len(static)
    highs, lows = _extremes(u, u, BLOCK)
    wide_highs, wide_lows = _extremes(highs, lows, MANY)
    offsets = np.zeros(size + 1, dtype=np.int64)
    places = np.empty(SPARE * size + count, dtype=np.int64)
    values = np.empty((len(places), 1))
    total = 0
    for g in range(size):
        places, values = _with_room(places, values, total, count + 1)
        stem, f_s, f_d = start[g], static[g], dynamic[g]
        places[total], values[total, 0] = 0, stem
        total += 1
        b = -1
        while b + 1 < len(highs):
            b += 1
            if b % MANY == 0:
                wide = b // MANY
                if not (wide_highs[wide] - stem > f_s or wide_lows[wide] - stem < -f_s):
                    b += MANY - 1
                    continue
            if not (highs[b] - stem > f_s or lows[b] - stem < -f_s):
                continue
            for k in range(b * BLOCK, min((b + 1) * BLOCK, count)):
                error = u[k] - stem
                if error > f_s:
                    moved = u[k] - f_d
                elif error < -f_s:
                    moved = u[k] + f_d
                else:
                    continue
                if moved != stem:
                    total += k > 0
                    places[total - 1], values[total - 1, 0] = k, moved
                    stem = moved
        offsets[g + 1] = total
    return offsets, places[:total], values[:total]


@compiled
def he_pattern_steps(
    u: FloatArray,
    jump: FloatArray,
    reverse: FloatArray,
    level: FloatArray,
    first: int,
    direction: float,
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return u at the last slip and its direction as rows of moves, and the bounds of cells.

    Bounds are rows (J low, J high, S low, S high), %: what stays and slips say of J and S.

    Args:
        u: OP, %, shape (N,).
        jump, reverse: J and S, %, shape (G,).
        level: stem before the first slip, %, shape (G,).
        first: sample of the first slip; −1 when J and S decide it as well.
        direction: of the first slip.
    """
    count, size = len(u), len(jump)
    highs, lows = _extremes(u, u, BLOCK)
    wide_highs, wide_lows = _extremes(highs, lows, MANY)
    offsets = np.zeros(size + 1, dtype=np.int64)
    places = np.empty(SPARE * size + count, dtype=np.int64)
    values = np.empty((len(places), 2))
    bounds = np.empty((size, 4))
    total = 0
    for g in range(size):
        places, values = _with_room(places, values, total, count + 1)
        base, sign, half = level[g], 0.0, 0.5 * (jump[g] + reverse[g])
        high, low = base + half, base - half
        j_low, j_high, s_low, s_high = 0.0, np.inf, 0.0, np.inf
        places[total], values[total, 0], values[total, 1] = 0, base, 0.0
        total += 1
        b = max(first, 0) // BLOCK - 1
        while b + 1 < len(highs):
            b += 1
            top, bottom, passed = highs[b], lows[b], 0
            if b % MANY == 0:
                wide_top, wide_bottom = wide_highs[b // MANY], wide_lows[b // MANY]
                if not (wide_top > high or wide_bottom < low):
                    top, bottom, passed = wide_top, wide_bottom, MANY - 1
            if b * BLOCK > first and not (top > high or bottom < low):
                b += passed
                if sign != 0.0:
                    above, below = top - base, base - bottom
                    j_low = max(j_low, above if sign > 0.0 else below)
                    s_low = max(s_low, below if sign > 0.0 else above)
                continue
            for k in range(max(b * BLOCK, first), min((b + 1) * BLOCK, count)):
                value = u[k]
                up, down = value > high, value < low
                if k == first:
                    up, down = direction > 0.0, not direction > 0.0
                elif sign != 0.0:
                    lead = sign * (value - base)
                    if not (up or down):
                        j_low, s_low = max(j_low, lead), max(s_low, -lead)
                    elif lead > 0.0:
                        j_high = min(j_high, lead)
                    elif lead < 0.0:
                        s_high = min(s_high, -lead)
                if up or down:
                    sign = 1.0 if up else -1.0
                    base = value
                    high = value + (jump[g] if up else reverse[g])
                    low = value - (reverse[g] if up else jump[g])
                    total += k > 0
                    places[total - 1], values[total - 1, 0], values[total - 1, 1] = k, base, sign
        offsets[g + 1] = total
        bounds[g, 0], bounds[g, 1], bounds[g, 2], bounds[g, 3] = j_low, j_high, s_low, s_high
    return offsets, places[:total], values[:total], bounds
