"""Compiled: the evidence of stems under a given noise and prior."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled_fused
from stiction_ros.effects.behaviour import FloatArray

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
def lagged(signal: FloatArray, before: float, first: int, taps: int) -> FloatArray:
    """Return rows of a signal and its past, one to ``taps`` samples back, shape (taps, N − first).

    Args:
        signal: shape (N,).
        before: its value before its first sample.
        first: sample of the first column.
        taps: M.
    """
    count = len(signal) - first
    out = np.empty((taps, count))
    for i in range(taps):
        for k in range(count):
            at = first + k - 1 - i
            out[i, k] = signal[at] if at >= 0 else before
    return out


@compiled_fused
def with_past(signal: FloatArray, taps: int) -> FloatArray:
    """Return a signal behind M samples of its first value, shape (M + N,)."""
    out = np.empty(taps + len(signal))
    out[:taps] = signal[0]
    out[taps:] = signal
    return out


@compiled_fused
def lagged_with(padded: FloatArray, other: FloatArray, taps: int) -> FloatArray:
    """Return the products of :func:`lagged` rows of a signal with another, shape (M,).

    Args:
        padded: the signal by :func:`with_past`.
        other: its last samples, shape (n,).
        taps: M.
    """
    out = np.empty(taps)
    for i in range(taps):
        start = len(padded) - len(other) - 1 - i
        out[i] = np.dot(padded[start : start + len(other)], other)
    return out


@compiled_fused
def lagged_products(left: FloatArray, right: FloatArray, count: int, taps: int) -> FloatArray:
    """Return the products of the :func:`lagged` rows of two signals, shape (M, M).

    Each follows from its neighbour up and left by two samples; only one row and one column are
    summed up.

    Args:
        left, right: by :func:`with_past`.
        count: n, samples of a row.
        taps: M.
    """
    start = len(left) - 1 - count
    out = np.empty((taps, taps))
    out[:, 0] = lagged_with(left, right[start : start + count], taps)
    out[0] = lagged_with(right, left[start : start + count], taps)
    for i in range(1, taps):
        enters, leaves = left[start - i], left[start - i + count]
        for j in range(1, taps):
            gone = leaves * right[start - j + count]
            out[i, j] = out[i - 1, j - 1] + enters * right[start - j] - gone
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
        root: L^-1, with L L^T the products of ``known`` and of M lags of each of ``others`` with
            each other and what is known of them before the record, shape (q, q).
        target: what all these leave of the output, shape (n,).
        energy: of that and of the prior of what explains the rest.
    """

    noise: FloatArray
    known: FloatArray
    others: FloatArray
    root: FloatArray
    target: FloatArray
    energy: float


@compiled_fused
def evidence(stem: FloatArray, given: Given, precision: FloatArray) -> tuple[float, FloatArray]:
    r"""Return −2 log of the marginal likelihood but for constants, and the response.

    .. math:: n \log(r / n) + \log\det(X X^T + K^{-1})

    with r what the response of the best fit and its prior leave of the target, and X the whitened
    lags of the stem but for what stands beside them explains. log det K is the caller's.

    Args:
        stem: scaled, shape (N,).
        given: everything else.
        precision: inverse of K, shape (M, M).
    """
    taps, known, count = len(precision), len(given.known), len(given.target)
    signal = with_past(whitened(given.noise, stem, stem[0]), taps)
    gram = lagged_products(signal, signal, count, taps)
    shared = np.empty((taps, len(given.root)))
    for row in range(known):
        shared[:, row] = lagged_with(signal, given.known[row], taps)
    for other in range(len(given.others)):
        at = known + other * taps
        shared[:, at : at + taps] = lagged_products(signal, given.others[other], count, taps)
    shared = np.dot(shared, given.root.T)
    gram -= np.dot(shared, shared.T)
    gram += precision
    determinant = factorised(gram)
    response, explained = solved(gram, lagged_with(signal, given.target, taps))
    left = max(given.energy - explained, LEAST * given.energy)
    return count * np.log(left / count) + determinant, response


@compiled_fused
def evidences(stems: FloatArray, given: Given, precision: FloatArray) -> FloatArray:
    """Return :func:`evidence` of many stems, shape (G, N)."""
    out = np.empty(len(stems))
    for g in range(len(stems)):
        out[g] = evidence(stems[g], given, precision)[0]
    return out
