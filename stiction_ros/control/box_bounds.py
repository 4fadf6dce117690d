"""Lower bounds of small convex quadratic problems in boxes, compiled."""

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray

# Changes of the active set: all that is wrong at once, then one at a time, which cannot cycle.
BOX_BOUND_ROUNDS = 6, 80


@compiled
def box_bounds(
    hessian: FloatArray,
    linear: FloatArray,
    jumps: tuple[NDArray[np.int64], FloatArray, NDArray[np.int64]],
    box: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Return lower bounds of min s'Qs/2 + g's with s in its box, one for each pattern.

    Args:
        hessian, linear: over all columns, shapes (c, c) and (c,).
        jumps: column and sign of each jump of each pattern, shapes (P, K), and their numbers (P,).
        box: least and largest size of each jump, shapes (P, K).
    """
    columns, signs, counts = jumps
    lower, upper = box
    found = np.zeros(len(counts))
    for p in range(len(counts)):
        size = counts[p]
        if size == 0:
            continue
        quadratic, gradient = np.empty((size, size)), np.empty(size)
        for i in range(size):
            gradient[i] = signs[p, i] * linear[columns[p, i]]
            for j in range(size):
                entry = hessian[columns[p, i], columns[p, j]]
                quadratic[i, j] = signs[p, i] * signs[p, j] * entry
        low, high = lower[p, :size], upper[p, :size]
        sizes = _in_box(quadratic, gradient, low, high)
        value = 0.0
        for i in range(size):
            slope = gradient[i]
            for j in range(size):
                slope += quadratic[i, j] * sizes[j]
            value += 0.5 * sizes[i] * (slope + gradient[i])
            # What the slope could still gain inside the box; rounding gains nothing.
            if slope > 0.0:
                value -= slope * (sizes[i] - low[i])
            elif sizes[i] < high[i] and slope < -1e-12 * abs(gradient[i]):
                value += slope * (high[i] - sizes[i])
        found[p] = value
    return found


@compiled
def _in_box(
    quadratic: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Return sizes in the box, the best ones unless the active set does not settle."""
    size = len(gradient)
    side = np.zeros(size, dtype=np.int64)  # -1 at its low end, 1 at its high end
    sizes = low.copy()
    for r in range(BOX_BOUND_ROUNDS[0] + BOX_BOUND_ROUNDS[1]):
        for i in range(size):
            if side[i] != 0:
                sizes[i] = low[i] if side[i] < 0 else high[i]
        _solve_free(quadratic, gradient, side, sizes)
        settled = True
        for i in range(size - 1, -1, -1):
            wanted = side[i]
            if side[i] == 0:
                if sizes[i] < low[i]:
                    wanted = -1
                elif sizes[i] > high[i]:
                    wanted = 1
            else:
                slope = gradient[i]
                for j in range(size):
                    slope += quadratic[i, j] * sizes[j]
                if slope * side[i] > 0.0:
                    wanted = 0
            if wanted != side[i]:
                side[i], settled = wanted, False
                if r >= BOX_BOUND_ROUNDS[0]:
                    break
        if settled:
            break
    for i in range(size):
        sizes[i] = min(max(sizes[i], low[i]), high[i])
    return sizes


@compiled
def _solve_free(
    quadratic: FloatArray, gradient: FloatArray, side: NDArray[np.int64], sizes: FloatArray
) -> None:
    """Put into ``sizes`` the optimum over those with side 0, the others fixed."""
    size = len(gradient)
    rows = np.empty(size, dtype=np.int64)
    count = 0
    for i in range(size):
        if side[i] == 0:
            rows[count] = i
            count += 1
    factor, right = np.empty((count, count)), np.empty(count)
    for a in range(count):
        i = rows[a]
        right[a] = -gradient[i]
        for j in range(size):
            if side[j] != 0:
                right[a] -= quadratic[i, j] * sizes[j]
    for a in range(count):  # Cholesky
        for b in range(a + 1):
            total = quadratic[rows[a], rows[b]]
            for k in range(b):
                total -= factor[a, k] * factor[b, k]
            if a == b:
                factor[a, a] = np.sqrt(max(total, 1e-300))
            else:
                factor[a, b] = total / factor[b, b]
    for a in range(count):
        for k in range(a):
            right[a] -= factor[a, k] * right[k]
        right[a] /= factor[a, a]
    for a in range(count - 1, -1, -1):
        for k in range(a + 1, count):
            right[a] -= factor[k, a] * right[k]
        right[a] /= factor[a, a]
        sizes[rows[a]] = right[a]
