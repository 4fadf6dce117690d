"""Compiled: the evidence of stems under a given noise and prior."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled_fused
from stiction_ros.effects.behaviour import FloatArray, IntArray

LEAST = 1e-12  # share of the output's energy that is always left


@compiled_fused
def whitened(noise: FloatArray, signal: FloatArray, before: float) -> FloatArray:
    """Return D(q) of a signal that was ``before`` before its first sample, shape (N,)."""
    out = np.empty(len(signal))
    for k in range(len(signal)):
        total = 0.0
        for i in range(len(noise)):
            total += noise[i] * (signal[k - i] if k >= i else before)
        out[k] = total
    return out


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
    out[taps:] = signal
    return out


@compiled_fused
def lagged_with(padded: FloatArray, other: FloatArray, edges: IntArray) -> FloatArray:
    """Return the products of the groups of lags of a signal with another, shape (r,).

    Args:
        padded: the signal by :func:`with_past`.
        other: its last samples, shape (n,).
        edges: group g sums lags ``edges[g] + 1`` to ``edges[g + 1]``, shape (r + 1,).
    """
    out = np.zeros(len(edges) - 1)
    for g in range(len(out)):
        for i in range(edges[g], edges[g + 1]):
            start = len(padded) - len(other) - 1 - i
            out[g] += np.dot(padded[start : start + len(other)], other)
    return out


@compiled_fused
def groups(edges: IntArray) -> IntArray:
    """Return the group of every lag, shape (M,); ``edges`` as in :func:`lagged_with`."""
    out = np.empty(edges[-1], dtype=np.int64)
    for g in range(len(edges) - 1):
        out[edges[g] : edges[g + 1]] = g
    return out


@compiled_fused
def lagged_products(left: FloatArray, right: FloatArray, count: int, edges: IntArray) -> FloatArray:
    """Return the products of the groups of lags of two signals, shape (r, r).

    Those of two lags follow from their neighbours up and left by two samples; only one row and
    one column are summed up.

    Args:
        left, right: by :func:`with_past`.
        count: n, samples of a row.
        edges: of the groups, as in :func:`lagged_with`.
    """
    size, taps, start = len(edges) - 1, edges[-1], len(left) - 1 - count
    out, group = np.zeros((size, size)), groups(edges)
    row, above = np.empty(taps), np.empty(taps)
    for j in range(taps):
        row[j] = np.dot(right[start - j : start - j + count], left[start : start + count])
    for i in range(taps):
        if i > 0:
            above, row = row, above
            row[0] = np.dot(left[start - i : start - i + count], right[start : start + count])
            enters, leaves = left[start - i], left[start - i + count]
            for j in range(1, taps):
                gone = leaves * right[start - j + count]
                row[j] = above[j - 1] + enters * right[start - j] - gone
        for j in range(taps):
            out[group[i], group[j]] += row[j]
    return out


@compiled_fused
def own_products(signal: FloatArray, count: int, edges: IntArray) -> FloatArray:
    """Return :func:`lagged_products` of a signal with itself, at half the work."""
    size, taps, start = len(edges) - 1, edges[-1], len(signal) - 1 - count
    out, group = np.zeros((size, size)), groups(edges)
    first, row = signal[start : start + count], np.empty(taps)
    for j in range(taps):
        row[j] = np.dot(signal[start - j : start - j + count], first)
    for i in range(taps):
        if i > 0:  # row[j] holds lags i and i + j
            enters, leaves = signal[start - i], signal[start - i + count]
            for j in range(taps - i):
                gone = leaves * signal[start - i - j + count]
                row[j] += enters * signal[start - i - j] - gone
        out[group[i], group[i]] += row[0]
        for j in range(1, taps - i):
            out[group[i], group[i + j]] += row[j]
            out[group[i + j], group[i]] += row[j]
    return out


@compiled_fused
def factorised(matrix: FloatArray) -> float:
    """Replace the lower triangle by its Cholesky factor; return the log determinant."""
    size, total = len(matrix), 0.0
    for j in range(size):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        pivot = np.sqrt(max(pivot, 1e-300))
        matrix[j, j] = pivot
        total += np.log(pivot)
        for i in range(j + 1, size):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value / pivot
    return 2.0 * total


@compiled_fused
def solved(factor: FloatArray, right: FloatArray) -> tuple[FloatArray, float]:
    """Return the solution for a Cholesky factor, and what it explains of the energy."""
    size = len(right)
    out, explained = right.copy(), 0.0
    for i in range(size):
        for k in range(i):
            out[i] -= factor[i, k] * out[k]
        out[i] /= factor[i, i]
        explained += out[i] * out[i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            out[i] -= factor[k, i] * out[k]
        out[i] /= factor[i, i]
    return out, explained


class Given(NamedTuple):
    """What stands beside one stem in one output, whitened.

    Attributes:
        noise: monic polynomial D, shape (d + 1,).
        known: rows of any signals, shape (c, n).
        others: stems of the other valves, by :func:`with_past`, shape (m − 1, M + N).
        root: L^-1, with L L^T the products of ``known`` and of the lags of each of ``others``
            with each other and what is known of them before the record, shape (q, q).
        target: what all these leave of the output, shape (n,).
        energy: of that and of the prior of what explains the rest.
        edges: of the groups of lags, shape (r + 1,).
    """

    noise: FloatArray
    known: FloatArray
    others: FloatArray
    root: FloatArray
    target: FloatArray
    energy: float
    edges: IntArray


@compiled_fused
def evidence(stem: FloatArray, given: Given, precision: FloatArray) -> tuple[float, FloatArray]:
    r"""Return −2 log of the marginal likelihood but for constants, and the response.

    .. math:: n \log(r / n) + \log\det(X X^T + K^{-1})

    with r what the response of the best fit and its prior leave of the target, and X the whitened
    lags of the stem but for what stands beside them explains. log det K is the caller's.

    Args:
        stem: scaled, shape (N,).
        given: everything else.
        precision: inverse of K, shape (r, r).
    """
    size, known, count = len(precision), len(given.known), len(given.target)
    signal = with_past(whitened(given.noise, stem, stem[0]), given.edges[-1])
    gram = own_products(signal, count, given.edges)
    shared = np.empty((size, len(given.root)))
    for row in range(known):
        shared[:, row] = lagged_with(signal, given.known[row], given.edges)
    for other in range(len(given.others)):
        at, beside = known + other * size, given.others[other]
        shared[:, at : at + size] = lagged_products(signal, beside, count, given.edges)
    shared = np.dot(shared, given.root.T)
    gram -= np.dot(shared, shared.T)
    gram += precision
    determinant = factorised(gram)
    response, explained = solved(gram, lagged_with(signal, given.target, given.edges))
    left = max(given.energy - explained, LEAST * given.energy)
    return count * np.log(left / count) + determinant, response


@compiled_fused
def evidences(stems: FloatArray, given: Given, precision: FloatArray) -> FloatArray:
    """Return :func:`evidence` of many stems, shape (G, N)."""
    out = np.empty(len(stems))
    for g in range(len(stems)):
        out[g] = evidence(stems[g], given, precision)[0]
    return out
