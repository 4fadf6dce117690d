"""Lagged products of many stems and switching patterns with themselves and with fixed signals.

Signals come as rows of moves, see :mod:`stiction_ros.identification.switching`.
Products with fixed signals are sums over moves: a fixed signal, filtered backwards in time and
summed up from its end, says at every sample what a step there contributes. Products of the signals
with themselves are sums over moves as well where there is no prefilter, otherwise over samples.
"""

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled, compiled_fused
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.kernels.copies import add_block, put
from stiction_ros.identification.kernels.delay import DEPENDENT, left_over

STEMS = 64  # whose products are kept at a time


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
def orthonormal(columns: FloatArray, tolerance: float) -> FloatArray:
    """Return orthonormal rows that span the given rows, shape (q, n).

    Rows of which those before leave less than ``tolerance`` are left out.
    """
    out = np.empty_like(columns)
    kept = 0
    for i in range(len(columns)):
        size = np.sqrt(np.dot(columns[i], columns[i]))
        if size < 1e-150:
            continue
        now = columns[i] / size
        for _ in range(2 if kept else 0):  # twice is enough for orthogonality to the last digit
            now -= np.dot(np.dot(out[:kept], now), out[:kept])
        size = np.sqrt(np.dot(now, now))
        if size > tolerance:
            put(out[kept], now / size)
            kept += 1
    return out[:kept].copy()


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
def _first_products(
    window: Window, places: IntArray, x: FloatArray, s: FloatArray, out: FloatArray
) -> None:
    """Write sums over k ≥ first of x[k − l] s[k − l − d] at the first l, shape (width,).

    From d − 1 to d the sum loses what s changes by at every move, times x at d − 1 later.
    """
    begin, end, rows = window.first - window.lag, window.samples - window.lag, len(places)
    now = 0.0
    for i in range(rows):
        until = min(places[i + 1], end) if i + 1 < rows else end
        now += max(until - max(places[i], begin), 0) * x[i] * s[i]
    out[0] = now
    for d in range(1, len(out)):
        for i in range(1, rows):
            k, at = places[i] + d - 1, i
            if begin <= k < end:
                while at + 1 < rows and places[at + 1] <= k:
                    at += 1
                now -= x[at] * (s[i] - s[i - 1])
        out[d] = now


@compiled
def _plain_products(
    window: Window, places: IntArray, values: FloatArray, room: FloatArray, out: FloatArray
) -> None:
    """Add lagged products of a signal to ``out``, shape (pairs, width, L).

    Args:
        room: for samples, shape (c, N).
    """
    channels, lags = len(room), window.lags
    begin, end = window.first - window.lag, window.samples - window.lag
    _samples(places, values, begin - lags + 1, begin, room)
    _samples(places, values, end - lags + 1, end, room)
    first = np.empty(window.width)
    for one in range(channels):
        for two in range(channels):
            _first_products(window, places, values[:, one], values[:, two], first)
            x, s, products = room[one], room[two], out[one + two]
            for d in range(len(first)):
                now = first[d]
                products[d, 0] += now
                for position in range(1, lags - d):
                    before, last = begin - position, end - position
                    now += x[before] * s[before - d] - x[last] * s[last - d]
                    products[d, position] += now


@compiled
def _driving(
    window: Window, offsets: IntArray, places: IntArray, values: FloatArray, out: FloatArray
) -> None:
    """Add the changes of D x of signals given by their moves, side by side, shape (c, N, G)."""
    for g in range(out.shape[2]):
        for c in range(len(out)):
            before = 0.0
            for move in range(offsets[g], offsets[g + 1]):
                step, at = values[move, c] - before, places[move]
                before = values[move, c]
                for d in range(min(len(window.numerator), window.samples - at)):
                    out[c, at + d, g] += step * window.numerator[d]


@compiled_fused
def _recursion(a: FloatArray, z: FloatArray) -> None:
    """Replace the changes of signals by their sums over A, in place, shape (N, G)."""
    order, size = len(a) - 1, z.shape[1]
    driving = np.zeros(size)
    for k in range(len(z)):
        now = z[k]
        for g in range(size):
            driving[g] += now[g]
            now[g] = driving[g]
        for i in range(min(order, k), 0, -1):
            factor, before = a[i], z[k - i]
            for g in range(size):
                now[g] -= factor * before[g]


@compiled_fused
def _products(window: Window, x: FloatArray, s: FloatArray) -> FloatArray:
    """Return sums over k ≥ first of x[k − l] s[k − l − d], shape (width, L, G)."""
    begin, end, size = window.first - window.lag, window.samples - window.lag, x.shape[1]
    out = np.zeros((window.width, window.lags, size))
    for k in range(begin, end):
        now = x[k]
        for d in range(window.width):
            total, before = out[d, 0], s[k - d]
            for g in range(size):
                total[g] += now[g] * before[g]
    for d in range(window.width):
        for position in range(1, window.lags - d):
            before, last = begin - position, end - position
            for g in range(size):
                gained = x[before, g] * s[before - d, g]
                lost = x[last, g] * s[last - d, g]
                out[d, position, g] = out[d, position - 1, g] + (gained - lost)
    return out


@compiled
def _filtered_products(
    window: Window, offsets: IntArray, places: IntArray, values: FloatArray, out: FloatArray
) -> None:
    """Add lagged products of signals through D/A to ``out``, shape (G, pairs, width, L)."""
    size, channels = len(out), values.shape[1]
    z = np.zeros((channels, window.samples, size))
    _driving(window, offsets, places, values, z)
    for c in range(channels):
        _recursion(window.denominator, z[c])
    for one in range(channels):
        for two in range(channels):
            sums = _products(window, z[one], z[two])
            for g in range(size):
                add_block(out[g, one + two], sums[:, :, g])


@compiled
def without_projections(products: FloatArray, one: FloatArray, two: FloatArray) -> None:
    """Subtract Σ_q one[l, q] two[l + d, q] from products[d, l], in place."""
    lags, columns = one.shape[0], one.shape[1] - 1
    for d in range(len(products)):
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
    size, channels, lags = len(offsets) - 1, values.shape[1], window.lags
    out = np.zeros((size, 2 * channels - 1, window.width, lags))
    right = np.empty((size, channels, lags))
    projected = np.empty((channels, lags, window.tails.shape[1]))
    room = np.zeros((channels, window.samples))
    plain = len(window.numerator) == 1 and len(window.denominator) == 1
    if not plain:
        _filtered_products(window, offsets, places, values, out)
    for g in range(size):
        part = slice(offsets[g], offsets[g + 1])
        if plain:
            _plain_products(window, places[part], values[part], room, out[g])
        for c in range(channels):
            _projected(window, places[part], values[part], c, projected[c])
            for position in range(lags):
                right[g, c, position] = projected[c, position, -1]
                value = out[g, 2 * c, 0, position]  # a stem that stands still says nothing
                out[g, 2 * c, 0, position] = value + value * DEPENDENT + 1e-200
        for one in range(channels):
            for two in range(channels):
                without_projections(out[g, one + two], projected[one], projected[two])
    return out, right


@compiled
def least_energy(
    window: Window, offsets: IntArray, places: IntArray, values: FloatArray, rest: float
) -> tuple[FloatArray, IntArray]:
    """Return the least SE of every stem over the delays, and that delay, both shape (G,)."""
    size = len(offsets) - 1
    least, delays = np.empty(size), np.empty(size, dtype=np.int64)
    for begin in range(0, size, STEMS):
        part = offsets[begin : min(begin + STEMS, size) + 1]
        products, right = step_products(window, part, places, values)
        energy = np.empty(window.lags - window.width + 1)
        for g in range(len(products)):
            left_over(products[g, 0], right[g, 0], rest, energy)
            delays[begin + g] = energy.argmin()
            least[begin + g] = energy[delays[begin + g]]
    return least, delays


@compiled
def best_apart(grid: FloatArray, loss: FloatArray, count: int, apart: float) -> IntArray:
    """Return up to ``count`` rows of least finite loss, at least ``apart`` from each other.

    Args:
        grid: shape (G, 2); rows are as far apart as the coordinate in which they are further.
        loss: shape (G,).
    """
    chosen = np.empty(count, dtype=np.int64)
    number = 0
    left = loss.copy()
    while number < count and len(left):
        best = int(left.argmin())
        if not left[best] < np.inf:
            break
        chosen[number] = best
        number += 1
        one, two = grid[best, 0], grid[best, 1]
        for g in range(len(left)):
            if abs(grid[g, 0] - one) < apart and abs(grid[g, 1] - two) < apart:
                left[g] = np.inf
        left[best] = np.inf
    return chosen[:number].copy()


def rows_apart(places: FloatArray, found: FloatArray, count: int, distance: float) -> list[int]:
    """Return the best of ``places``; what lies just at the distance, as in a grid, is too near."""
    beyond = float(np.nextafter(distance, np.inf))
    return [int(i) for i in best_apart(places, found, count, beyond)]
