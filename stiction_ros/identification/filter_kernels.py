"""Prefiltered stems and patterns, several side by side, and their lagged products, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled, compiled_fused
from stiction_ros.effects.behaviour import FloatArray

IntArray = NDArray[np.int64]

SHORT = 3  # largest n_a and n_b for which a filter is written out
LANES = 8  # signals that are filtered side by side


class Window(NamedTuple):
    """What of a scan is the same for all signals.

    Attributes:
        samples, first: N and the first sample of the criterion.
        lag, lags: first lag and number of lags.
        width: n_b, number of lags of one delay.
        tails: what a step at each sample adds to the products with the projected columns, and
            in the last column with the rest, at lag 0, shape (N + lag + lags, q + 1).
        numerator, denominator: D and A of the prefilter.
    """

    samples: int
    first: int
    lag: int
    lags: int
    width: int
    tails: FloatArray
    numerator: FloatArray
    denominator: FloatArray


@compiled
def driving(
    window: Window,
    offsets: IntArray,
    places: IntArray,
    values: FloatArray,
    group: int,
    out: FloatArray,
) -> None:
    """Write the changes of D x of the signals from ``group`` on side by side, shape (N, LANES).

    Lane ``LANES / c · channel + i`` holds a channel of signal ``group`` + i.
    """
    channels = values.shape[1]
    each = LANES // channels
    order = len(window.numerator)
    for k in range(window.samples):
        for g in range(LANES):
            out[k, g] = 0.0
    for i in range(min(each, len(offsets) - 1 - group)):
        for c in range(channels):
            before, lane = 0.0, each * c + i
            for row in range(offsets[group + i], offsets[group + i + 1]):
                step, at = values[row, c] - before, places[row]
                before = values[row, c]
                for d in range(min(order, window.samples - at)):
                    out[at + d, lane] += step * window.numerator[d]


@compiled
def _recursion(a: FloatArray, z: FloatArray) -> None:
    """Replace changes by the sum of them over A, in place, shape (N, LANES)."""
    driving = np.zeros(LANES)
    for k in range(len(z)):
        for g in range(LANES):
            driving[g] += z[k, g]
            z[k, g] = driving[g]
        for i in range(min(len(a) - 1, k), 0, -1):
            weight = a[i]
            for g in range(LANES):
                z[k, g] -= weight * z[k - i, g]


@compiled_fused
def _short_recursion(a: FloatArray, begin: int, end: int, z: FloatArray, out: FloatArray) -> None:
    """Do as :func:`_recursion` for n_a ≤ 3 and write Σ z[k] z[k − d], shape (3, LANES).

    Four lanes at a time are written out, so that all that repeats stays in registers.
    """
    a1, a2, a3 = a[1], a[2] if len(a) > 2 else 0.0, a[3] if len(a) > 3 else 0.0
    for h in range(0, LANES, 4):
        x0 = x1 = x2 = x3 = 0.0  # driving
        p0 = p1 = p2 = p3 = q0 = q1 = q2 = q3 = r0 = r1 = r2 = r3 = 0.0  # z one, two, three before
        s0 = s1 = s2 = s3 = t0 = t1 = t2 = t3 = v0 = v1 = v2 = v3 = 0.0  # sums of d = 0, 1, 2
        for k in range(len(z)):
            x0, x1, x2, x3 = x0 + z[k, h], x1 + z[k, h + 1], x2 + z[k, h + 2], x3 + z[k, h + 3]
            y0 = x0 - a3 * r0 - a2 * q0 - a1 * p0
            y1 = x1 - a3 * r1 - a2 * q1 - a1 * p1
            y2 = x2 - a3 * r2 - a2 * q2 - a1 * p2
            y3 = x3 - a3 * r3 - a2 * q3 - a1 * p3
            z[k, h], z[k, h + 1], z[k, h + 2], z[k, h + 3] = y0, y1, y2, y3
            if begin <= k < end:
                s0, s1, s2, s3 = s0 + y0 * y0, s1 + y1 * y1, s2 + y2 * y2, s3 + y3 * y3
                t0, t1, t2, t3 = t0 + y0 * p0, t1 + y1 * p1, t2 + y2 * p2, t3 + y3 * p3
                v0, v1, v2, v3 = v0 + y0 * q0, v1 + y1 * q1, v2 + y2 * q2, v3 + y3 * q3
            r0, r1, r2, r3 = q0, q1, q2, q3
            q0, q1, q2, q3 = p0, p1, p2, p3
            p0, p1, p2, p3 = y0, y1, y2, y3
        out[0, h], out[0, h + 1], out[0, h + 2], out[0, h + 3] = s0, s1, s2, s3
        out[1, h], out[1, h + 1], out[1, h + 2], out[1, h + 3] = t0, t1, t2, t3
        out[2, h], out[2, h + 1], out[2, h + 2], out[2, h + 3] = v0, v1, v2, v3


@compiled
def _lane_products(window: Window, z: FloatArray, crossed: int, out: FloatArray) -> None:
    """Write sums over k ≥ first of z[k − l, g] z[k − l − d, g] at the first l, ``out[:, 0]``.

    Crossed, the second factor comes from the lane that is half of the lanes further.
    """
    begin, end = window.first - window.lag, window.samples - window.lag
    now = np.empty(LANES)
    for d in range(min(window.width, window.lags)):
        for g in range(LANES):
            now[g] = 0.0
        for k in range(begin, end):
            one, two = z[k], z[k - d]
            if crossed:
                for g in range(LANES // 2):
                    now[g] += one[g] * two[g + LANES // 2]
                    now[g + LANES // 2] += one[g + LANES // 2] * two[g]
            else:
                for g in range(LANES):
                    now[g] += one[g] * two[g]
        for g in range(LANES):
            out[d, 0, g] = now[g]


@compiled
def _along_lags(window: Window, z: FloatArray, crossed: int, out: FloatArray) -> None:
    """Complete the products of the first lag, ``out[:, 0]``, shape (width, L, LANES)."""
    lags, begin, end = window.lags, window.first - window.lag, window.samples - window.lag
    half = LANES // 2 if crossed else 0
    for d in range(min(window.width, lags)):
        for position in range(1, lags - d):
            before, last = begin - position, end - position
            for g in range(LANES):
                other = (g + half) % LANES
                gained = z[before, g] * z[before - d, other] - z[last, g] * z[last - d, other]
                out[d, position, g] = out[d, position - 1, g] + gained


@compiled
def filtered_products(window: Window, z: FloatArray, crossed: bool, out: FloatArray) -> None:
    """Filter what drives the lanes, in place, and write their lagged products.

    Args:
        z: changes of D x, shape (N, LANES).
        out: shape (2, width, L, LANES); the second part, crossed, for two channels only.
    """
    begin, end = window.first - window.lag, window.samples - window.lag
    short = len(window.denominator) <= SHORT + 1 and window.width <= SHORT
    if short:
        sums = np.empty((SHORT, LANES))
        _short_recursion(window.denominator, begin, end, z, sums)
        for d in range(window.width):
            for g in range(LANES):
                out[0, d, 0, g] = sums[d, g]
    else:
        _recursion(window.denominator, z)
    for part in range(2 if crossed else 1):
        if part or not short:
            _lane_products(window, z, part, out[part])
        _along_lags(window, z, part, out[part])
