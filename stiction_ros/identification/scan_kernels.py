"""Filters, lagged products and the small least-squares problems of whole batches of stems.

Signals are time-major, shape (N, G): the inner loops run over the batch.
"""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray

DEPENDENT = 1e-13
RIDGE = 1e-12


@compiled
def filtered(numerator: FloatArray, denominator: FloatArray, x: FloatArray) -> FloatArray:
    """Return numerator / denominator applied to x, shape (N, G), from rest; both start with 1."""
    count, size = x.shape
    out = x.copy()
    for k in range(count):
        now = out[k]
        for i in range(1, min(len(numerator), k + 1)):
            weight, before = numerator[i], x[k - i]
            for g in range(size):
                now[g] += weight * before[g]
        for i in range(1, min(len(denominator), k + 1)):
            weight, before = denominator[i], out[k - i]
            for g in range(size):
                now[g] -= weight * before[g]
    return out


@compiled
def lagged_products(
    x: FloatArray, s: FloatArray, first: int, lag: int, lags: int, width: int
) -> FloatArray:
    """Return sums over k ≥ first of x[k − l] s[k − l − d], shape (width, lags, G).

    Row d holds l = ``lag`` + 0 … lags − 1 − d; the rest of it is zero.

    Args:
        x, s: shape (N, G).
    """
    count, size = x.shape
    out = np.zeros((width, lags, size))
    now = np.empty(size)
    for d in range(min(width, lags)):
        now[:] = 0.0
        for k in range(first - lag, count - lag):
            one, two = x[k], s[k - d]
            for g in range(size):
                now[g] += one[g] * two[g]
        out[d, 0] = now
        for position in range(1, lags - d):
            last, before = count - lag - position, first - lag - position
            for g in range(size):
                now[g] += x[before, g] * s[before - d, g] - x[last, g] * s[last - d, g]
            out[d, position] = now
    return out


@compiled
def subtract_projections(products: FloatArray, px: FloatArray, ps: FloatArray) -> None:
    """Subtract Σ_q px[l, q] ps[l + d, q] from products[d, l], in place.

    Args:
        products: shape (width, L, G).
        px, ps: shape (L, q, G).
    """
    lags, basis, size = px.shape
    for d in range(min(len(products), lags)):
        for position in range(lags - d):
            now = products[d, position]
            for q in range(basis):
                one, two = px[position, q], ps[position + d, q]
                for g in range(size):
                    now[g] -= one[g] * two[g]


@compiled
def explained_energy(products: FloatArray, right: FloatArray) -> FloatArray:
    """Return bᵀ M⁻¹ b for every delay, shape (G, T).

    M of delay t holds the lagged products of the lags t … t + width − 1. What the projected
    columns leave nothing of is rounding and explains nothing.

    Args:
        products: symmetric lagged products, as :func:`lagged_products`, shape (width, L, G).
        right: products with what is to be explained, shape (L, G).
    """
    width, lags, size = products.shape
    delays = lags - width + 1
    out = np.zeros((size, delays))
    matrix, vector, diagonal = np.empty((width, width)), np.empty(width), np.empty(width)
    for g in range(size):
        for t in range(delays):
            sound = True
            for i in range(width):
                diagonal[i] = products[0, t + i, g]
                sound = sound and diagonal[i] > 0.0
                vector[i] = right[t + i, g]
                for j in range(i):
                    matrix[i, j] = products[i - j, t + j, g]
                matrix[i, i] = diagonal[i] * (1.0 + RIDGE * (1.0 + i))
            if not sound:
                continue
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
            out[g, t] = total
    return out
