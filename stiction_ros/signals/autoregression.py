r"""Autoregressive noise of one signal: its fit, a signal made white, and one made of white noise.

Two ways to write it: coefficients φ of :math:`r_k = \sum_i \varphi_i r_{k-i} + e_k`, and the monic
polynomial D with :math:`D(q) r_k = e_k`, which is 1, −φ_1, …, −φ_p.
"""

import math

import numpy as np

from stiction_ros.compiled import compiled, compiled_fused
from stiction_ros.deferred import lfilter
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.signals.arx import lagged

LOAD = 1e-8  # of the noise's variance, that keeps its equations regular
TINY = 1e-300
TINY_POWER = 1e-9  # of a noise, that is forgotten
_TRACE_SHARE = 1e-12


def whiten(values: FloatArray, ar: FloatArray) -> FloatArray:
    """Return values_k − Σ φ_i values_{k−i} along the first axis; zeros before the start."""
    out = np.array(values, dtype=float, copy=True)
    for lag, coefficient in enumerate(ar.tolist(), start=1):
        out[lag:] -= coefficient * values[:-lag]
    return out


def coloured(white: FloatArray, ar: FloatArray) -> FloatArray:
    """Return r_k = Σ φ_i r_{k−i} + white_k along the first axis: the inverse of :func:`whiten`."""
    return np.asarray(lfilter([1.0], np.concatenate([[1.0], -ar]), white, axis=0))


@compiled
def inner_product(first: FloatArray, second: FloatArray) -> float:
    """Return Σ first second, in four interleaved sums."""
    count = len(first)
    a = b = c = d = 0.0
    whole = count - count % 4
    for k in range(0, whole, 4):
        a += first[k] * second[k]
        b += first[k + 1] * second[k + 1]
        c += first[k + 2] * second[k + 2]
        d += first[k + 3] * second[k + 3]
    for k in range(whole, count):
        a += first[k] * second[k]
    return (a + b) + (c + d)


@compiled
def whitened_rows(values: FloatArray, ar: FloatArray, rows: BoolArray) -> FloatArray:
    """Return values_k − Σ φ_i values_{k−i} at the marked rows alone, zeros before the start."""
    white = values.copy()
    for lag in range(1, min(len(ar), len(values)) + 1):
        factor = ar[lag - 1]
        for k in range(lag, len(values)):
            white[k] -= factor * values[k - lag]
    at = 0
    for k in range(len(values)):
        if rows[k]:
            white[at] = white[k]
            at += 1
    return white[:at].copy()


@compiled
def _lagged_products(residual: FloatArray, rows: BoolArray, most: int) -> FloatArray:
    """Return Σ r_{k−i} r_{k−j} over the marked rows, shape (most + 1, most + 1), i ≤ j alone.

    One sample later the sum of the same lag differs by the products at the ends of blocks.
    """
    count = len(residual)
    gram = np.zeros((most + 1, most + 1))
    marked, ends, found = np.zeros(count), np.empty(count, dtype=np.int64), 0
    for k in range(count):
        if rows[k]:
            marked[k] = residual[k]
        if rows[k] != (k + 1 < count and rows[k + 1]):
            ends[found] = k
            found += 1
    for lag in range(min(most, count - 1) + 1):
        value = inner_product(marked[lag:], residual[: count - lag])
        gram[0, lag] = value
        for i in range(most - lag):
            for end in ends[:found]:
                at = end - i
                if at >= lag:
                    product = residual[at] * residual[at - lag]
                    value += -product if rows[end] else product
            gram[i + 1, i + 1 + lag] = value
    return gram


@compiled
def best_autoregression(
    residual: FloatArray, rows: BoolArray, most: int
) -> tuple[FloatArray, float]:
    """Return φ of the order of least BIC up to ``most``, and n log Σe² + p log n.

    Least squares on the n marked rows; one Cholesky factor of the normal equations holds those
    of every lower order.
    """
    gram = _lagged_products(residual, rows, most)
    ridge, count = TINY, 0
    for lag in range(most + 1):
        ridge += _TRACE_SHARE * gram[lag, lag]
    for marked in rows:
        count += 1 if marked else 0
    count = max(count, 2)
    factor, half = np.zeros((most, most)), np.zeros(most)
    best_order, left = 0, gram[0, 0]
    best_score = count * np.log(max(left, TINY))
    for n in range(most):
        for j in range(n + 1):
            value = gram[j + 1, n + 1] + (ridge if j == n else 0.0)
            for i in range(j):
                value -= factor[n, i] * factor[j, i]
            if j < n:
                factor[n, j] = value / factor[j, j]
        if not value > 0.0:
            break
        factor[n, n] = np.sqrt(value)
        half[n] = gram[0, n + 1]
        for i in range(n):
            half[n] -= factor[n, i] * half[i]
        half[n] /= factor[n, n]
        left -= half[n] ** 2
        score = count * np.log(max(left, TINY)) + (n + 1) * np.log(count)
        if score < best_score:
            best_order, best_score = n + 1, score
    phi = np.zeros(best_order)
    for n in range(best_order - 1, -1, -1):
        value = half[n]
        for i in range(n + 1, best_order):
            value -= factor[i, n] * phi[i]
        phi[n] = value / factor[n, n]
    return phi, best_score


@compiled_fused
def whitened(noise: FloatArray, signal: FloatArray, before: float) -> FloatArray:
    """Return D(q) of a signal that was ``before`` before its first sample, shape (N,)."""
    out = np.zeros(len(signal))
    for i in range(len(noise)):
        by, late, source = noise[i], out[i:], signal[: max(len(signal) - i, 0)]
        for k in range(len(source)):
            late[k] += by * source[k]
        for k in range(min(i, len(signal))):
            out[k] += by * before
    return out


def noise_of(values: FloatArray, order: int) -> FloatArray:
    """Return the monic polynomial D of a signal, (N,), by least squares, shape (order + 1,)."""
    past = np.array(lagged(values, range(1, order + 1), order))
    gram = past @ past.T + LOAD * float(values @ values) * np.eye(order)
    return np.append(1.0, -np.linalg.solve(gram, past @ values[order:]))


def innovations(noise: FloatArray, values: FloatArray) -> FloatArray:
    """Return D(q) of a signal that was at its first value before, shape (N,)."""
    return whitened(noise, values, float(values[0]))


def companion(ar: FloatArray) -> FloatArray:
    """Return the states of an autoregression, the first of which is seen, shape (p, p)."""
    states = np.zeros((len(ar), len(ar)))
    if len(ar):
        states[:, 0] = ar
        states[:-1, 1:] += np.eye(len(ar) - 1)
    return states


def gain_of_noise(ar: FloatArray) -> float:
    """Return the variance of an autoregressive process of unit innovations."""
    order = len(ar)
    if not order:
        return 1.0
    states = companion(ar)
    if np.abs(np.linalg.eigvals(states)).max() >= 1.0 - 1e-9:
        return math.inf
    total, passed = np.zeros((order, order)), states.T
    total[0, 0] = 1.0
    while np.abs(passed).max() > TINY_POWER:  # twice as many samples with every turn
        total += passed @ total @ passed.T
        passed = passed @ passed
    return float(total[0, 0])
