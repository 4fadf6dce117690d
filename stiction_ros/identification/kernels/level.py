"""The best level of switching patterns, compiled: SE as a function of f_D and its minimum."""

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.kernels.delay import left_over

ZOOMS = 16
POINTS = 5
EXACT_ENOUGH = 1.0  # second difference of the loss from which a parabola is exact enough


@compiled
def _loss(
    products: FloatArray, rights: FloatArray, scales: FloatArray, level: float, delays: IntArray
) -> float:
    """Return the loss of one pattern over all outputs, and write its delays.

    Args:
        products: by :func:`.scan.step_products` of base with itself, base with sign and sign with
            itself, shape (p, 3, width, L).
        rights: of base and sign with the rest, shape (p, 2, L).
        scales: rows (energy of the rest, number of samples, delays).
    """
    total = 0.0
    for p in range(len(products)):
        rest, count = scales[p, 0], scales[p, 1]
        energy, parts = np.empty(int(scales[p, 2])), products[p]
        own = parts[0] - level * parts[1] + level * level * parts[2]
        left_over(own, rights[p, 0] - level * rights[p, 1], rest, energy)
        best = int(energy.argmin())
        delays[p] = best
        total += count * np.log(energy[best] / count)
    return total


@compiled
def best_levels(
    products: FloatArray, rights: FloatArray, scales: FloatArray, ranges: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Minimise over the level of every pattern inside its range.

    Args:
        products, rights: as those of one pattern in :func:`_loss`, shape (G, p, …).
        scales: rows (energy of the rest, number of samples, delays) per output.
        ranges: of the level, shape (G, 2).

    Returns:
        Best level (G,), second derivative (G,), loss (G,), delays (G, p) from 0.
    """
    size, outputs = len(products), len(scales)
    level, second = np.empty(size), np.empty(size)
    lowest, delays = np.empty(size), np.empty((size, outputs), dtype=np.int64)
    at, loss = np.empty(POINTS), np.empty(POINTS)
    now = np.empty((POINTS, outputs), dtype=np.int64)
    for g in range(size):
        low, high = ranges[g]
        step, best, middle, bend = 0.0, 0, 1, 0.0
        for zoom in range(ZOOMS):
            for i in range(POINTS):
                if zoom == 0 or i % 2 == 1:
                    at[i] = low + 0.25 * i * (high - low)
                    loss[i] = _loss(products[g], rights[g], scales, at[i], now[i])
            best = int(loss.argmin())
            middle = min(max(best, 1), POINTS - 2)
            step = max(0.25 * (high - low), 1e-300)
            bend = max(loss[middle - 1] - 2.0 * loss[middle] + loss[middle + 1], 0.0)
            if bend < EXACT_ENOUGH or zoom == ZOOMS - 1:
                break
            low, high = at[middle - 1], at[middle + 1]
            # The ends and the middle of the next range are known; in this order none is lost.
            for to, known in ((0, middle - 1), (POINTS - 1, middle + 1), (POINTS // 2, middle)):
                at[to], loss[to] = at[known], loss[known]
                for p in range(outputs):
                    now[to, p] = now[known, p]
        slope = 0.5 * (loss[middle - 1] - loss[middle + 1])
        level[g], lowest[g] = at[best], loss[best]
        for p in range(outputs):
            delays[g, p] = now[best, p]
        if bend > 0.0 and abs(slope) < bend:
            shift = slope / bend
            level[g] = at[middle] + shift * step
            lowest[g] = loss[middle] - 0.5 * slope * shift
        second[g] = bend / step**2
    return level, second, lowest, delays
