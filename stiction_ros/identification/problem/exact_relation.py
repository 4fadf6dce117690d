"""Which stretches of a record may obey an exact linear relation, compiled."""

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled_fused
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.lanes import LANES, put, row, spread


@compiled_fused
def explained_stretches(
    own: FloatArray,
    others: FloatArray,
    lags: tuple[int, int],
    starts: IntArray,
    width: int,
    error: float,
) -> NDArray[np.bool_]:
    """Return which stretches of ``own`` may be explained up to ``error`` at every sample.

    The root of the sum of squares that orthogonalisation leaves is compared with what such an
    error allows. Columns that depend on others can only lower what is left, so no stretch that
    may count is passed over; others may come along.

    Args:
        own: shape (N,), explained by its own lags from 1 on and
        others: of the same size, shape (q, N).
        lags: the last lag, and the first one of the others.
        starts: first samples of the stretches less the last lag, shape (w,).
        width: samples of a stretch, at least as many as lags.
    """
    last, least = lags
    columns = last + len(others) * (last + 1 - least)
    out = np.zeros(len(starts), dtype=np.bool_)
    rows = np.empty((columns + 1, width, LANES))  # of several stretches side by side
    left = np.empty((1, LANES))
    nothing = spread(1e-300)
    for begin in range(0, len(starts), LANES):
        for lane in range(LANES):
            first = starts[min(begin + lane, len(starts) - 1)] + last
            for k in range(width):
                rows[columns, k, lane] = own[first + k]
            for lag in range(1, last + 1):
                for k in range(width):
                    rows[lag - 1, k, lane] = own[first + k - lag]
            q = last
            for other in others:
                for lag in range(least, last + 1):
                    for k in range(width):
                        rows[q, k, lane] = other[first + k - lag]
                    q += 1
        for q in range(columns + 1):
            of, length = LANES * q * width, nothing
            for k in range(0, LANES * width, LANES):
                now = row(rows, of + k)
                length = length + now * now
            put(left, 0, length)
            for other in range(q + 1, columns + 1):
                to, share = LANES * other * width, spread(0.0)
                for k in range(0, LANES * width, LANES):
                    share = share + row(rows, of + k) * row(rows, to + k)
                share = share / length
                for k in range(0, LANES * width, LANES):
                    put(rows, to + k, row(rows, to + k) - share * row(rows, of + k))
        for lane in range(min(LANES, len(starts) - begin)):
            out[begin + lane] = np.sqrt(left[0, lane]) <= 2.0 * error * np.sqrt(width)
    return out
