"""Which stretches of a record may obey an exact linear relation, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled_fused
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.lanes import LANES, put, row, spread


@compiled_fused
def explained_stretches(
    regressors: FloatArray, target: FloatArray, starts: NDArray[np.int64], width: int, error: float
) -> NDArray[np.bool_]:
    """Return which stretches may be explained up to ``error`` at every sample.

    The root of the sum of squares that orthogonalisation leaves is compared with what such an
    error allows. Columns that depend on others can only lower what is left, so no stretch that
    may count is passed over; others may come along.

    Args:
        regressors: shape (N, q), columns of the size of ``target``.
        target: shape (N,).
        starts: first samples, shape (w,).
        width: samples of a stretch, at least q.
    """
    columns = regressors.shape[1]
    out = np.zeros(len(starts), dtype=np.bool_)
    rows = np.empty((columns + 1, width, LANES))  # of several stretches side by side
    left = np.empty((1, LANES))
    nothing = spread(1e-300)
    for begin in range(0, len(starts), LANES):
        for lane in range(LANES):
            start = starts[min(begin + lane, len(starts) - 1)]
            for k in range(width):
                for q in range(columns):
                    rows[q, k, lane] = regressors[start + k, q]
                rows[columns, k, lane] = target[start + k]
        for q in range(columns + 1):
            length = nothing
            for k in range(width):
                now = row(rows, q * width + k)
                length = length + now * now
            put(left, 0, length)
            for other in range(q + 1, columns + 1):
                share = spread(0.0)
                for k in range(width):
                    share = share + row(rows, q * width + k) * row(rows, other * width + k)
                share = share / length
                for k in range(width):
                    rest = row(rows, other * width + k) - share * row(rows, q * width + k)
                    put(rows, other * width + k, rest)
        for lane in range(min(LANES, len(starts) - begin)):
            out[begin + lane] = np.sqrt(left[0, lane]) <= 2.0 * error * np.sqrt(width)
    return out
