"""Compiled: stems as sums of few steps, and the products of their lags under a given noise."""

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled_fused
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.kernels.copies import put, put_block
from stiction_ros.signals.autoregression import whitened

EIGHT = 8  # stems that are turned at once: a line of the cache


@compiled_fused
def answered(signal: FloatArray, response: FloatArray) -> FloatArray:
    """Return what an impulse response makes of a signal, shape (N,).

    Args:
        signal: shape (N,); it was at its first value before.
        response: from one sample on, shape (M,).
    """
    out, before = np.zeros(len(signal)), 0.0
    for i in range(len(response)):
        past = i + 1
        for k in range(past, len(signal)):
            out[k] += response[i] * signal[k - past]
        before += response[i]
    for k in range(min(len(response), len(signal))):
        out[k] += before * signal[0]
        before -= response[k]
    return out


@compiled_fused
def with_past(signal: FloatArray, taps: int) -> FloatArray:
    """Return a signal behind M samples of its first value, shape (M + N,)."""
    out = np.empty(taps + len(signal))
    out[:taps] = signal[0]
    put(out[taps:], signal)
    return out


class Moves(NamedTuple):
    """A stem as what it does: it stays, and moves now and then."""

    begin: float  # its first value, and that before
    at: IntArray  # rows in which it moves, shape (c,)
    by: FloatArray  # how far, shape (c,)


@compiled_fused
def moves_of(stem: FloatArray) -> Moves:
    """Return the moves of a stem, shape (N,)."""
    count, last = 0, stem[0]
    at, by = np.empty(len(stem), dtype=np.int64), np.empty(len(stem))
    for k in range(1, len(stem)):
        value = stem[k]
        if value != last:
            at[count], by[count] = k, value - last
            count += 1
            last = value
    return Moves(stem[0], at[:count], by[:count])


@compiled_fused
def step_products(noise: FloatArray, other: FloatArray, rows: int, taps: int) -> FloatArray:
    """Return what D(q) of a unit step has in common with another signal, for steps at every row.

    A stem is a sum of few steps, so its products with one signal cost one sum over its moves each,
    whatever its lag: :func:`lag_products`.

    Args:
        noise: monic polynomial D, shape (d + 1,).
        other: its last samples, shape (n,), n + d ≤ N.
        rows: N.
        taps: M.

    Returns:
        Products of ``other`` with the last n samples of D(q) of a step at row k, from N on zero,
        shape (N + M,).
    """
    out, first = np.zeros(rows + taps), rows - len(other)
    for i in range(len(noise)):
        by, early = noise[i], out[first - i : rows - i]
        for k in range(len(other)):
            early[k] += by * other[k]
    total = 0.0
    for k in range(rows - 1, -1, -1):
        total += out[k]
        out[k] = total
    return out


@compiled_fused
def lag_products(moves: Moves, products: FloatArray, taps: int) -> FloatArray:
    """Return the products of lags 1 to M of D(q) of a stem with a signal, shape (M,).

    Args:
        moves: of the stem.
        products: of steps with that signal, by :func:`step_products`.
        taps: M.
    """
    out = np.full(taps, moves.begin * products[0])
    at, by = moves.at, moves.by
    pairs = len(at) // 2 * 2
    for m in range(0, pairs, 2):  # two at once, as sums are fetched and put back as often then
        first, then = products[at[m] + 1 :], products[at[m + 1] + 1 :]
        for i in range(taps):
            out[i] = (out[i] + by[m] * first[i]) + by[m + 1] * then[i]
    for m in range(pairs, len(at)):
        step = products[at[m] + 1 :]
        for i in range(taps):
            out[i] += by[m] * step[i]
    return out


@compiled_fused
def grouped(lags: FloatArray, edges: IntArray) -> FloatArray:
    """Return the sums over groups of lags, shape (r,).

    Args:
        lags: one figure for each lag, shape (M,).
        edges: group g sums lags ``edges[g] + 1`` to ``edges[g + 1]``, shape (r + 1,).
    """
    out = np.zeros(len(edges) - 1)
    for g in range(len(out)):
        for i in range(edges[g], edges[g + 1]):
            out[g] += lags[i]
    return out


@compiled_fused
def lagged_products(
    left: FloatArray, right: FloatArray, begun: tuple[FloatArray, FloatArray], edges: IntArray
) -> FloatArray:
    """Return the products of the groups of lags of two signals, shape (r, r).

    Those of two lags follow from their neighbours up and left by two samples.

    Args:
        left, right: the last M + n + 1 samples, those before the record included.
        begun: products of every lag of ``left`` with the first lag of ``right``, and of the first
            lag of ``left`` with every lag of ``right``, each of shape (M,).
        edges: of the groups, as in :func:`grouped`.
    """
    size, taps = len(edges) - 1, edges[-1]
    out, end = np.zeros((size, size)), len(left) - 1
    row, above, turned = np.empty(taps), np.empty(taps), right[::-1].copy()
    for g in range(size):
        for i in range(edges[g], edges[g + 1]):
            row, above = above, row
            if i == 0:
                put(row, begun[1])
            else:
                row[0] = begun[0][i]
                enters, leaves = left[taps - i], left[end - i]
                came, gone = turned[len(left) - taps :], turned[1:]
                for j in range(1, taps):
                    row[j] = above[j - 1] + enters * came[j - 1] - leaves * gone[j - 1]
            for h in range(size):
                for j in range(edges[h], edges[h + 1]):
                    out[g, h] += row[j]
    return out


@compiled_fused
def own_products(signal: FloatArray, begun: FloatArray, edges: IntArray) -> FloatArray:
    """Return :func:`lagged_products` of a signal with itself, at half the work.

    Args:
        signal: the last M + n + 1 samples, those before the record included.
        begun: products of every lag with the first, shape (M,).
        edges: of the groups, as in :func:`grouped`.
    """
    size, taps = len(edges) - 1, edges[-1]
    out, end = np.zeros((size, size)), len(signal) - 1
    row, turned = begun.copy(), signal[::-1].copy()
    for g in range(size):
        for i in range(edges[g], edges[g + 1]):  # row[j] holds lags i and i + j
            if i > 0:
                enters, leaves = signal[taps - i], signal[end - i]
                came, gone = turned[len(signal) - 1 - taps + i :], turned[i:]
                for j in range(taps - i):
                    row[j] += enters * came[j] - leaves * gone[j]
            out[g, g] += row[0]
            for j in range(i + 1, edges[g + 1]):
                out[g, g] += 2.0 * row[j - i]
            for h in range(g + 1, size):
                for j in range(edges[h], edges[h + 1]):
                    out[g, h] += row[j - i]
    for g in range(size):
        for h in range(g):
            out[g, h] = out[h, g]
    return out


class Products(NamedTuple):
    """What the groups of lags of some stems have in common with each other and with signals."""

    # the last M + n + 1 samples of each stem, those before the record included, whitened, shape (m,
    # M + n + 1)
    past: FloatArray
    first: FloatArray  # ``step_products`` with the first lag of each, shape (m, N + M + 8)
    beside: FloatArray  # products with the signals, shape (c, m r)
    shared: FloatArray  # with each other, shape (m r, m r)


@compiled_fused
def beside_lags(
    noise: FloatArray, stems: FloatArray, signals: FloatArray, edges: IntArray
) -> FloatArray:
    """Return the products of the groups of lags of stems with signals, shape (c, m r).

    Args:
        noise: monic polynomial D, shape (d + 1,).
        stems: not whitened, shape (m, N).
        signals: whitened, shape (c, n).
        edges: of the groups, as in :func:`grouped`.
    """
    valves, rows = stems.shape
    taps, size = edges[-1], len(edges) - 1
    out = np.empty((len(signals), valves * size))
    moves = [moves_of(stems[i]) for i in range(valves)]
    for row in range(len(signals)):
        seen = step_products(noise, signals[row], rows, taps)
        for i in range(valves):
            at = i * size
            put(out[row, at : at + size], grouped(lag_products(moves[i], seen, taps), edges))
    return out


@compiled_fused
def products_of(
    noise: FloatArray, stems: FloatArray, signals: FloatArray, edges: IntArray
) -> Products:
    """Return the products of stems, scaled, shape (m, N), with signals, shape (c, n).

    Args:
        noise: monic polynomial D, shape (d + 1,).
        stems: not whitened.
        signals: whitened.
        edges: of the groups, as in :func:`grouped`.
    """
    valves, rows = stems.shape
    taps, size, count = edges[-1], len(edges) - 1, signals.shape[1]
    past, first = np.empty((valves, taps + count + 1)), np.empty((valves, rows + taps))
    whole = valves * size
    shared = np.empty((whole, whole))
    beside = beside_lags(noise, stems, signals, edges)
    for i in range(valves):
        moves, at = moves_of(stems[i]), i * size
        white = with_past(whitened(noise, stems[i], stems[i, 0]), taps)
        put(past[i], white[-(taps + count + 1) :])
        put(first[i], step_products(noise, past[i, -1 - count : -1], rows, taps))
        for j in range(i):
            along, theirs = j * size, moves_of(stems[j])
            begun = (lag_products(moves, first[j], taps), lag_products(theirs, first[i], taps))
            found = lagged_products(past[i], past[j], begun, edges)
            put_block(shared[at : at + size, along : along + size], found)
            put_block(shared[along : along + size, at : at + size], found.T)
        own = own_products(past[i], lag_products(moves, first[i], taps), edges)
        put_block(shared[at : at + size, at : at + size], own)
    return Products(past, first, beside, shared)


@compiled_fused
def in_rows(stems: FloatArray, rate: int, skipped: int, scale: float) -> FloatArray:
    """Return stems, shape (N, G), as means of ``rate`` samples over ``scale``, shape (G, n).

    Args:
        stems: with n · rate samples at least.
        rate: samples a row.
        skipped: rows of delay; the first row stands for what was before.
        scale: divides all.
    """
    rows, size, by = len(stems) // rate, stems.shape[1], 1.0 / (rate * scale)
    out = np.empty((size, rows))
    for begin in range(0, size, EIGHT):
        end = min(begin + EIGHT, size)
        for k in range(rows):
            source = max(k - skipped, 0) * rate
            for g in range(begin, end):
                total = stems[source, g]
                for i in range(1, rate):
                    total += stems[source + i, g]
                out[g, k] = by * total
    return out
