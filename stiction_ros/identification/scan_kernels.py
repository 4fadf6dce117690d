"""Lagged products and the small least-squares problems of many stems and switching patterns.

Signals come as rows of moves, see :mod:`.step_signals`. Products with fixed signals are sums
over moves: a fixed signal, filtered backwards in time and summed up from its end, says at every
sample what a step there contributes. Products of the signals with themselves are sums over
stretches without a move where there is no prefilter, otherwise over samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray

IntArray = NDArray[np.int64]

DEPENDENT = 1e-13
RIDGE = 1e-12
SAME = 1e-9
MOVES_APART = 20  # samples from move to move, above which stretches are added up
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
        rest: energy of the rest.
    """

    samples: int
    first: int
    lag: int
    lags: int
    width: int
    tails: FloatArray
    numerator: FloatArray
    denominator: FloatArray
    rest: float


@compiled
def orthonormal(columns: FloatArray, tolerance: float) -> FloatArray:
    """Return orthonormal rows that span the given rows, shape (q, n).

    Rows of which those before leave less than ``tolerance`` are left out.
    """
    out = np.empty_like(columns)
    kept = 0
    for i in range(len(columns)):
        now = columns[i].copy()
        size = np.sqrt(np.dot(now, now))
        if size < 1e-150:
            continue
        now /= size
        for _ in range(2):  # twice is enough for orthogonality to the last digit
            if kept:
                now -= np.dot(np.dot(out[:kept], now), out[:kept])
        size = np.sqrt(np.dot(now, now))
        if size > tolerance:
            out[kept] = now / size
            kept += 1
    return out[:kept].copy()


@compiled
def _projected(
    window: Window, places: IntArray, values: FloatArray, channel: int, out: FloatArray
) -> None:
    """Write the products of a signal's lags with the columns and the rest, shape (L, q + 1)."""
    width = window.tails.shape[1]
    tails, flat = window.tails.reshape(-1), out.reshape(-1)  # lags follow each other in both
    flat[:] = 0.0
    before = 0.0
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
def _filtered(
    window: Window,
    offsets: IntArray,
    places: IntArray,
    values: FloatArray,
    group: int,
    out: FloatArray,
) -> None:
    """Write D/A of the signals from ``group`` on side by side, shape (N, LANES).

    Lane ``LANES / c · channel + i`` holds a channel of signal ``group`` + i.
    """
    channels = values.shape[1]
    each = LANES // channels
    out[:] = 0.0
    order = len(window.numerator)
    for i in range(min(each, len(offsets) - 1 - group)):
        for c in range(channels):
            before, lane = 0.0, each * c + i
            for row in range(offsets[group + i], offsets[group + i + 1]):
                step, at = values[row, c] - before, places[row]
                before = values[row, c]
                for d in range(min(order, window.samples - at)):
                    out[at + d, lane] += step * window.numerator[d]
    a = window.denominator
    driving = np.zeros(LANES)
    for k in range(window.samples):
        for g in range(LANES):
            driving[g] += out[k, g]
            out[k, g] = driving[g]
        for i in range(min(len(a) - 1, k), 0, -1):
            weight = a[i]
            for g in range(LANES):
                out[k, g] -= weight * out[k - i, g]


@compiled
def _filtered_products(window: Window, z: FloatArray, crossed: bool, out: FloatArray) -> None:
    """Write sums of z[k − l, g] z[k − l − d, g], shape (width, L, LANES).

    Crossed, the second factor comes from the lane that is half of the lanes further.
    """
    lags, begin, end = window.lags, window.first - window.lag, window.samples - window.lag
    half = LANES // 2 if crossed else 0
    now = np.empty(LANES)
    for d in range(min(window.width, lags)):
        now[:] = 0.0
        for k in range(begin, end):
            one, two = z[k], z[k - d]
            if crossed:
                for g in range(LANES // 2):
                    now[g] += one[g] * two[g + LANES // 2]
                    now[g + LANES // 2] += one[g + LANES // 2] * two[g]
            else:
                for g in range(LANES):
                    now[g] += one[g] * two[g]
        out[d, 0] = now
        for position in range(1, lags - d):
            before, last = begin - position, end - position
            for g in range(LANES):
                other = (g + half) % LANES
                now[g] += z[before, g] * z[before - d, other] - z[last, g] * z[last - d, other]
            out[d, position] = now


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
        at, lane = places[part], g % each
        if not plain and lane == 0:
            _filtered(window, offsets, places, values, g, z)
            _filtered_products(window, z, False, lanes[0])
            if channels == 2:
                _filtered_products(window, z, True, lanes[1])
        if plain:
            _plain_products(window, at, values[part], room, pairs)
        for c in range(channels):
            _projected(window, at, values[part], c, projected[c])
            right[g, c] = projected[c, :, -1]
            products = out[g, 2 * c]
            if plain:
                products[:] = pairs[3 * c]
            else:
                products[:] = lanes[0, :, :, each * c + lane]
            products[0] *= 1.0 + DEPENDENT  # a ridge, as a stem that stands still says nothing
            products[0] += 1e-200
            _without_projections(products, projected[c], projected[c])
        if channels == 2:
            products = out[g, 1]
            if plain:
                products[:] = pairs[1] + pairs[2]
            else:
                products[:] = lanes[1, :, :, lane] + lanes[1, :, :, each + lane]
            _without_projections(products, projected[0], projected[1])
            _without_projections(products, projected[1], projected[0])
    return out, right


@compiled
def _left_over(
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
def step_energy(
    window: Window, offsets: IntArray, places: IntArray, values: FloatArray
) -> FloatArray:
    """Return SE of stems at every delay, shape (G, T)."""
    products, right = step_products(window, offsets, places, values)
    delays = window.lags - window.width + 1
    room = np.empty((window.width + 2, window.width))
    out = np.empty((len(products), delays))
    for g in range(len(products)):
        for t in range(delays):
            out[g, t] = _left_over(products[g, 0], right[g, 0], t, window.rest, room)
    return out
