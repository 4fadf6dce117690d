"""Squared innovations for every point of a grid of responses, compiled."""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.likelihood.kernels import whitened_block
from stiction_ros.effects.behaviour import BoolArray, FloatArray, IntArray
from stiction_ros.signals.autoregression import TINY, inner_product

_RIDGE = 1e-10
_ROUNDING = 1e-14


@compiled
def left_of_shifts(
    target: FloatArray,
    shift: FloatArray,
    rows: IntArray,
    basis: FloatArray,
    ar: FloatArray,
) -> FloatArray:
    """Return the squared innovations that each response leaves, shape (G,).

    Args:
        target: whitened gap without the shared columns, shape (n,).
        shift: responses, shape (N, G).
        rows: of ``target`` among the N, rising.
        basis: orthonormal, of the whitened shared columns, shape (n, r).
        ar: φ, shape (p,).
    """
    size, rank = shift.shape[1], basis.shape[1]
    squares, inside = np.zeros(size), np.zeros((rank, size))
    white = np.empty(size)
    for n in range(len(rows)):
        k, wanted = rows[n], target[n]
        for g in range(size):
            white[g] = wanted - shift[k, g]
        for i in range(min(len(ar), k)):
            factor = ar[i]
            for g in range(size):
                white[g] += factor * shift[k - 1 - i, g]
        for g in range(size):
            squares[g] += white[g] * white[g]
        for c in range(rank):
            weight = basis[n, c]
            for g in range(size):
                inside[c, g] += weight * white[g]
    for c in range(rank):
        for g in range(size):
            squares[g] -= inside[c, g] * inside[c, g]
    return squares


@compiled
def _solved(gram: FloatArray, cross: FloatArray) -> FloatArray:
    """Return the solution of positive definite equations; both arguments are used up."""
    count = len(cross)
    for i in range(count):
        for j in range(i):
            share = gram[i, j] / gram[j, j]
            cross[i] -= share * cross[j]
            for k in range(j, count):
                gram[i, k] -= share * gram[j, k]
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            cross[i] -= gram[i, j] * cross[j]
        cross[i] /= gram[i, i]
    return cross


@compiled
def taken_by_sizes(
    target: FloatArray,
    sizes: FloatArray,
    rows: BoolArray,
    basis: FloatArray,
    ar: FloatArray,
) -> FloatArray:
    """Return the squares that least squares of the factors takes away, shape (G,).

    Args:
        target, ar: as for :func:`left_of_shifts`; the shared columns are not in ``target``.
        sizes: columns of the factors, shape (N, G, s).
        rows: which of the N are those of ``target``, shape (N,).
        basis: as for :func:`left_of_shifts`, but of shape (r, n).
    """
    points, count, rank = sizes.shape[1], sizes.shape[2], len(basis)
    taken, inside = np.empty(points), np.empty((count, rank))
    gram, cross = np.empty((count, count)), np.empty(count)
    for g in range(points):
        white = whitened_block(sizes[:, g].T.copy(), ar, rows, 0.0)
        for s in range(count):
            for c in range(rank):
                inside[s, c] = inner_product(white[s], basis[c])
        ridge = TINY
        for s in range(count):
            cross[s] = inner_product(white[s], target)
            for t in range(s + 1):
                whole = inner_product(white[s], white[t])
                left = whole - inner_product(inside[s], inside[t])
                gram[s, t] = gram[t, s] = left
            ridge += _RIDGE * left + _ROUNDING * whole
        for s in range(count):
            gram[s, s] += ridge
        wanted = cross.copy()
        taken[g] = inner_product(_solved(gram, wanted), cross)
    return taken
