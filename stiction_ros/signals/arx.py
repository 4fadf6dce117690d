r"""Columns of an ARX equation: an output at its own lags, inputs at theirs.

.. math:: y_k = \sum_{i=1}^{n_a} \alpha_i y_{k-i} + \sum_j \sum_{i=1}^{n_b} b_{ji} x^{(j)}_{k-d_j-i}
"""

from collections.abc import Iterable, Sequence

from stiction_ros.effects.behaviour import FloatArray


def lagged(values: FloatArray, lags: Iterable[int], first: int) -> list[FloatArray]:
    """Return for each lag the samples so much before those from ``first`` on, (N − first,) each.

    Args:
        values: shape (N,).
        lags: samples, 0 to ``first``.
        first: row.
    """
    return [values[first - lag : len(values) - lag] for lag in lags]


def arx_columns(
    y: FloatArray,
    inputs: Iterable[FloatArray],
    delays: Sequence[int],
    orders: tuple[int, int],
    first: int,
) -> list[FloatArray]:
    """Return the columns of y, then those of each input, shape (N − first,) each.

    Args:
        y: shape (N,).
        inputs: shape (N,) each.
        delays: d of each input, samples; −1 for one whose present counts.
        orders: n_a and n_b.
        first: row, at least n_a and every d + n_b.
    """
    past, width = orders
    columns = lagged(y, range(1, past + 1), first)
    for x, delay in zip(inputs, delays, strict=True):
        columns += lagged(x, range(delay + 1, delay + 1 + width), first)
    return columns
