"""Lagged products and the small least-squares problems of many stems and switching patterns.

Signals come as rows of moves, see :mod:`.step_signals`. Products with fixed signals are sums
over moves: a fixed signal, filtered backwards in time and summed up from its end, says at every
sample what a step there contributes. Products of the signals with themselves are sums over
stretches without a move where there is no prefilter, otherwise over samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.filter_kernels import (
    LANES,
    Window,
    driving,
    filtered_products,
)

IntArray = NDArray[np.int64]

DEPENDENT = 1e-13
RIDGE = 1e-12
SAME = 1e-9
MOVES_APART = 20  # samples from move to move, above which stretches are added up


@compiled
def _projected(
    window: Window, places: IntArray, values: FloatArray, channel: int, out: FloatArray
) -> None:
    """Write the products of a signal's lags with the columns and the rest, shape (L, q + 1)."""
    width = window.tails.shape[1]
    tails, flat = window.tails.reshape(-1), out.reshape(-1)  # lags follow each other in both
    before = 0.0
    for at in range(len(flat)):
        flat[at] = 0.0
    for i in range(len(places)):
        step = values[i, channel] - before
        before = values[i, channel]
        if step != 0.0:
            start = (places[i] + window.lag) * width
            part = tails[start : start + len(flat)]
            for at in range(len(flat)):
                flat[at] += step * part[at]


@compiled
def _stretch_product(
    places: IntArray, x: FloatArray, s: FloatArray, shift: int, begin: int, end: int
) -> float:
    """Return the sum of x[j] s[j − shift] over begin ≤ j < end, of signals given by moves."""
    last, i, m, total, j = len(places) - 1, 0, 0, 0.0, begin
    while i < last and places[i + 1] <= j:
        i += 1
    while m < last and places[m + 1] + shift <= j:
        m += 1
    while j < end:
        until = end
        if i < last:
            until = min(until, places[i + 1])
        if m < last:
            until = min(until, places[m + 1] + shift)
        total += (until - j) * x[i] * s[m]
        j = until
        i += i < last and places[i + 1] == j
        m += m < last and places[m + 1] + shift == j
    return total


@compiled
def _samples(places: IntArray, values: FloatArray, begin: int, end: int, out: FloatArray) -> None:
    """Write samples ``begin`` to ``end`` of a signal into the same places, shape (c, N)."""
    i = len(places) - 1
    while end > begin:
        while places[i] >= end:
            i -= 1
        at = max(begin, places[i])
        for c in range(len(out)):
            value = values[i, c]
            for j in range(at, end):
                out[c, j] = value
        end = at


@compiled
def _plain_products(
    window: Window, places: IntArray, values: FloatArray, room: FloatArray, out: FloatArray
) -> None:
    """Write sums over k ≥ first of x[k − l] s[k − l − d], shape (c², width, L).

    Channels x and s are the quotient and the rest of the row by c.

    Args:
        room: for samples, shape (c, N).
    """
    channels, lags = len(room), window.lags
    begin, end = window.first - window.lag, window.samples - window.lag
    often = len(places) * MOVES_APART > end - begin
    if often:
        _samples(places, values, begin - lags + 1, end, room)
    else:
        _samples(places, values, begin - lags + 1, begin, room)
        _samples(places, values, end - lags + 1, end, room)
    for pair in range(len(out)):
        one, two = pair // channels, pair % channels
        x, s = room[one], room[two]
        for d in range(min(window.width, lags)):
            if often:
                now = np.dot(x[begin:end], s[begin - d : end - d])
            else:
                now = _stretch_product(places, values[:, one], values[:, two], d, begin, end)
            out[pair, d, 0] = now
            for position in range(1, lags - d):
                before, last = begin - position, end - position
                now += x[before] * s[before - d] - x[last] * s[last - d]
                out[pair, d, position] = now


@compiled
def _without_projections(products: FloatArray, one: FloatArray, two: FloatArray) -> None:
    """Subtract Σ_q one[l, q] two[l + d, q] from products[d, l], in place."""
    lags, columns = one.shape[0], one.shape[1] - 1
    for d in range(min(len(products), lags)):
        for position in range(lags - d):
            total = 0.0
            for q in range(columns):
                total += one[position, q] * two[position + d, q]
            products[d, position] -= total


@compiled
def step_products(
    window: Window, offsets: IntArray, places: IntArray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return lagged products of what the columns leave of signals, and those with the rest.

    Returns:
        Shape (G, pairs, width, L): of a signal with itself; of two channels with themselves
        (first and last) and with each other, both ways added up. Row d holds the first L − d.
        Shape (G, c, L): with the rest.
    """
    size, channels = len(offsets) - 1, values.shape[1]
    lags, width = window.lags, window.width
    out = np.zeros((size, 2 * channels - 1, width, lags))
    right = np.empty((size, channels, lags))
    projected = np.empty((channels, lags, window.tails.shape[1]))
    pairs = np.zeros((channels**2, width, lags))
    room = np.zeros((channels, window.samples))
    plain = len(window.numerator) == 1 and len(window.denominator) == 1
    each = LANES // channels
    z = np.empty((1 if plain else window.samples, LANES))
    lanes = np.zeros((2, width, lags, LANES))
    for g in range(size):
        part = slice(offsets[g], offsets[g + 1])
        at, of, lane = places[part], values[part], g % each
        if plain:
            _plain_products(window, at, of, room, pairs)
        elif lane == 0:
            driving(window, offsets, places, values, g, z)
            filtered_products(window, z, channels == 2, lanes)
        for c in range(channels):
            _projected(window, at, of, c, projected[c])
            for position in range(lags):
                right[g, c, position] = projected[c, position, -1]
        for pair in range(channels**2):
            one, two = pair // channels, pair % channels
            products = out[g, one + two]
            for d in range(width):
                for position in range(lags):
                    if plain:
                        value = pairs[pair, d, position]
                    else:
                        value = lanes[one ^ two, d, position, each * one + lane]
                    if d == 0 and one == two:  # as a stem that stands still says nothing
                        value += value * DEPENDENT + 1e-200
                    products[d, position] += value
            _without_projections(products, projected[one], projected[two])
    return out, right


@compiled
def left_over(
    products: FloatArray, right: FloatArray, delay: int, rest: float, matrix: FloatArray
) -> float:
    """Return SE at one delay: the rest's energy less bᵀ M⁻¹ b.

    M holds the lagged products of the lags from ``delay`` on. What the projected columns leave
    nothing of is rounding and explains nothing, and so does what explains more than all.

    Args:
        products: shape (width, L).
        right: shape (L,).
        matrix: room for the problem, shape (width + 2, width).
    """
    width = len(products)
    vector, diagonal = matrix[width], matrix[width + 1]
    for i in range(width):
        diagonal[i] = products[0, delay + i]
        if not diagonal[i] > 0.0:
            return rest
        vector[i] = right[delay + i]
        for j in range(i):
            matrix[i, j] = products[i - j, delay + j]
        matrix[i, i] = diagonal[i] * (1.0 + RIDGE * (1.0 + i))
    total = 0.0
    for i in range(width):
        pivot = matrix[i, i]
        if pivot <= DEPENDENT * diagonal[i]:
            continue
        total += vector[i] * vector[i] / pivot
        for j in range(i + 1, width):
            factor = matrix[j, i] / pivot
            vector[j] -= factor * vector[i]
            for below in range(i + 1, j + 1):
                matrix[j, below] -= factor * matrix[below, i]
    if total > rest * (1.0 + SAME):
        return rest
    return max(rest - total, 1e-12 * rest)


@compiled
def delay_energy(products: FloatArray, right: FloatArray, rest: float) -> FloatArray:
    """Return SE of stems at every delay, shape (G, T), from what :func:`step_products` gives."""
    width, lags = products.shape[2], products.shape[3]
    room = np.empty((width + 2, width))
    out = np.empty((len(products), lags - width + 1))
    for g in range(len(out)):
        for t in range(out.shape[1]):
            out[g, t] = left_over(products[g, 0], right[g, 0], t, rest, room)
    return out
