"""Which stretches of a record may obey an exact linear relation, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray


@compiled
def explained_stretches(
    regressors: FloatArray, target: FloatArray, starts: NDArray[np.int64], width: int, error: float
) -> NDArray[np.bool_]:
    """Return which stretches may be explained up to ``error`` at every sample.

    The root of the sum of squares that Householder's decomposition leaves is compared with
    what such an error allows. Columns that depend on others can only lower what is left, so
    no stretch that may count is passed over; others may come along.

    Args:
        regressors: shape (N, q), columns of the size of ``target``.
        target: shape (N,).
        starts: first samples, shape (w,).
        width: samples of a stretch, at least q.
    """
    columns = regressors.shape[1]
    out = np.zeros(len(starts), dtype=np.bool_)
    rows = np.empty((columns + 1, width))
    for w in range(len(starts)):
        begin = starts[w]
        for q in range(columns):
            for k in range(width):
                rows[q, k] = regressors[begin + k, q]
        rows[columns] = target[begin : begin + width]
        for q in range(columns):
            pivot = rows[q, q:].copy()
            size = np.sqrt(np.dot(pivot, pivot))
            pivot[0] += size if pivot[0] >= 0.0 else -size
            length = np.dot(pivot, pivot)
            if length == 0.0:
                continue
            for other in range(q + 1, columns + 1):
                part = rows[other, q:]
                share = 2.0 * np.dot(pivot, part) / length
                for k in range(len(part)):
                    part[k] -= share * pivot[k]
        left = rows[columns, columns:]
        out[w] = np.sqrt(np.dot(left, left)) <= 2.0 * error * np.sqrt(width)
    return out
