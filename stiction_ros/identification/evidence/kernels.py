"""Compiled: the evidence of stems under a given noise and prior."""

from __future__ import annotations

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
def lagged_products(rows: FloatArray, signal: FloatArray, before: float, first: int) -> FloatArray:
    """Return the products of :func:`lagged` rows with each other, shape (M, M).

    Each follows from its neighbour up and left by two samples; only one row is summed up.
    """
    taps, count = rows.shape
    out = np.empty((taps, taps))
    out[0] = np.dot(rows, rows[0])
    for i in range(1, taps):
        out[i, 0] = out[0, i]
        enters, leaves = first - 1 - i, first - 1 - i + count
        a = signal[enters] if enters >= 0 else before
        b = signal[leaves] if leaves >= 0 else before
        for j in range(i, taps):
            enters, leaves = first - 1 - j, first - 1 - j + count
            c = signal[enters] if enters >= 0 else before
            d = signal[leaves] if leaves >= 0 else before
            out[i, j] = out[i - 1, j - 1] + a * c - b * d
            out[j, i] = out[i, j]
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


@compiled_fused
def evidence(
    stem: FloatArray,
    noise: FloatArray,
    fixed: FloatArray,
    target: FloatArray,
    energy: float,
    precision: FloatArray,
) -> tuple[float, FloatArray]:
    r"""Return −2 log of the marginal likelihood but for constants, and the response.

    .. math:: n \log(r / n) + \log\det(X X^T + K^{-1})

    with r what the response of the best fit and its prior leave of the target, and X the whitened
    lags of the stem but for what the fixed rows explain. log det K is the caller's.

    Args:
        stem: scaled, shape (N,).
        noise: monic polynomial D, shape (d + 1,).
        fixed: rows R that explain what they can, R^T R of a signal, shape (q, n).
        target: what they leave of the whitened output, shape (n,).
        energy: of that and of the prior of what explains the rest.
        precision: inverse of K, shape (M, M).
    """
    first = len(stem) - len(target)
    before = stem[0]
    signal = whitened(noise, stem, before)
    rest_of_past = signal[0]
    rows = lagged(signal, rest_of_past, first, len(precision))
    gram = lagged_products(rows, signal, rest_of_past, first)
    shared = np.dot(rows, fixed.T)
    gram -= np.dot(shared, shared.T)
    gram += precision
    determinant = factorised(gram)
    response, explained = solved(gram, np.dot(rows, target))
    left = max(energy - explained, LEAST * energy)
    count = len(target)
    return count * np.log(left / count) + determinant, response


@compiled_fused
def evidences(
    stems: FloatArray,
    noise: FloatArray,
    fixed: FloatArray,
    target: FloatArray,
    energy: float,
    precision: FloatArray,
) -> FloatArray:
    """Return :func:`evidence` of many stems, shape (G, N)."""
    out = np.empty(len(stems))
    for g in range(len(stems)):
        out[g] = evidence(stems[g], noise, fixed, target, energy, precision)[0]
    return out
