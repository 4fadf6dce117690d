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
        for k in range(width):
            for q in range(columns):
                rows[q, k] = regressors[starts[w] + k, q]
            rows[columns, k] = target[starts[w] + k]
        for q in range(columns):
            length = 0.0
            for k in range(q, width):
                length += rows[q, k] * rows[q, k]
            if length == 0.0:
                continue
            size = np.sqrt(length)
            length = 2.0 * (length + size * abs(rows[q, q]))
            rows[q, q] += size if rows[q, q] >= 0.0 else -size
            for other in range(q + 1, columns + 1):
                share = 0.0
                for k in range(q, width):
                    share += rows[q, k] * rows[other, k]
                share *= 2.0 / length
                for k in range(q, width):
                    rows[other, k] -= share * rows[q, k]
        left = 0.0
        for k in range(columns, width):
            left += rows[columns, k] * rows[columns, k]
        out[w] = np.sqrt(left) <= 2.0 * error * np.sqrt(width)
    return out
