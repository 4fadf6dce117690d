"""Prefiltered stems and patterns, several side by side, and their lagged products, compiled."""

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled, compiled_fused
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.lanes import LANES, halves_swapped, put, row, spread


class Window(NamedTuple):
    """What of a scan is the same for all signals."""

    samples: int  # samples, first: N and the first sample of the criterion
    first: int
    lag: int  # lag, lags: first lag and number of lags
    lags: int
    width: int  # n_b, number of lags of one delay
    # what a step at each sample adds to the products with the projected columns, and in the last
    # column with the rest, at lag 0, shape (N + lag + lags, q + 1)
    tails: FloatArray
    numerator: FloatArray  # numerator, denominator: D and A of the prefilter
    denominator: FloatArray


@compiled
def _driving(
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
            for move in range(offsets[group + i], offsets[group + i + 1]):
                step, at = values[move, c] - before, places[move]
                before = values[move, c]
                for d in range(min(order, window.samples - at)):
                    out[at + d, lane] += step * window.numerator[d]


@compiled_fused
def _recursion(a: FloatArray, z: FloatArray) -> None:
    """Replace changes by the sum of them over A, in place, shape (N, LANES)."""
    order = len(a) - 1
    a1, a2, a3 = 0.0, 0.0, 0.0  # the last three samples stay in registers
    if order > 0:
        a1 = a[1]
    if order > 1:
        a2 = a[2]
    if order > 2:
        a3 = a[3]
    driving, one, two, three = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
    for k in range(len(z)):
        driving = driving + row(z, LANES * k)
        now = driving - a3 * three - a2 * two
        for i in range(min(order, k), 3, -1):
            now = now - a[i] * row(z, LANES * (k - i))
        now = now - a1 * one
        put(z, LANES * k, now)
        three, two, one = two, one, now


@compiled_fused
def _products(window: Window, z: FloatArray, crossed: int, out: FloatArray) -> None:
    """Write sums over k ≥ first of z[k − l] z[k − l − d], shape (width, L, LANES).

    Unless ``crossed`` is 0, the second factor comes from the lane half of the lanes further on.
    """
    lags, width = window.lags, window.width
    begin, end = window.first - window.lag, window.samples - window.lag
    for one in range(0, width, 3):  # three d at a time, at the end the last one repeatedly
        two, three = min(one + 1, width - 1), min(one + 2, width - 1)
        a, b, c = spread(0.0), spread(0.0), spread(0.0)
        for k in range(begin, end):
            now = row(z, LANES * k)
            if crossed:
                now = halves_swapped(now)
            a = a + now * row(z, LANES * (k - one))
            b = b + now * row(z, LANES * (k - two))
            c = c + now * row(z, LANES * (k - three))
        for d, total in ((one, a), (two, b), (three, c)):
            put(out, LANES * d * lags, total)
            for position in range(1, lags - d):
                before = row(z, LANES * (begin - position))
                last = row(z, LANES * (end - position))
                if crossed:
                    before, last = halves_swapped(before), halves_swapped(last)
                gained = before * row(z, LANES * (begin - position - d))
                total = total + (gained - last * row(z, LANES * (end - position - d)))
                put(out, LANES * (d * lags + position), total)


@compiled
def filtered_products(
    window: Window, offsets: IntArray, places: IntArray, values: FloatArray, out: FloatArray
) -> None:
    """Write lagged products of filtered signals, shape (G, pairs, width, L).

    Pairs as :func:`.scan.step_products` has them.
    """
    size, channels = len(out), values.shape[1]
    each = LANES // channels
    z = np.empty((window.samples, LANES))
    sums = np.zeros((channels, window.width, window.lags, LANES))
    for group in range(0, size, each):
        _driving(window, offsets, places, values, group, z)
        _recursion(window.denominator, z)
        for crossed in range(channels):
            _products(window, z, crossed, sums[crossed])
        for lane in range(min(each, size - group)):
            for d in range(window.width):
                for position in range(window.lags):
                    now = sums[:, d, position]
                    out[group + lane, 0, d, position] = now[0, lane]
                    if channels > 1:
                        other = each + lane
                        out[group + lane, 1, d, position] = now[1, lane] + now[1, other]
                        out[group + lane, 2, d, position] = now[0, other]
