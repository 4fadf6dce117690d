"""Filtered stems and the small least-squares problems of all their delays, compiled.

Signals are time-major, shape (N, G): the inner loops run over the batch.
"""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects import FloatArray

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
        products: sums of x[k − l] x[k − l − d] at [d, l], shape (width, L, G).
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
