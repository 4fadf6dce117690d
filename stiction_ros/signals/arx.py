r"""One ARX equation: its columns, and its free run, the output computed from the inputs alone.

.. math:: y_k = c + \sum_j \sum_{i=1}^{n_b} b_{ji} x^{(j)}_{k-d_j-i} - \sum_{i=1}^{n_a} a_i y_{k-i}
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from stiction_ros.deferred import lfilter
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.polynomials import filtered, largest_root


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


def driven(
    b: Iterable[ArrayLike], delays: Sequence[int], inputs: Iterable[FloatArray], constant: float
) -> FloatArray:
    """Return the right-hand side but for the past of y, shape (N,).

    Args:
        b: taps of each input, shape (n_b,) each.
        delays: d of each input, samples, 0 or more.
        inputs: shape (N,) each; each was at its first value before.
        constant: c.
    """
    rows = list(inputs)
    count = len(rows[0])
    out = np.full(count, constant)
    for row, delay, x in zip(b, delays, rows, strict=True):
        taps = np.asarray(row, dtype=float)
        late = np.concatenate([np.full(delay + 1, x[0]), x])[:count]
        before = np.cumsum(taps[::-1])[::-1][1:] * x[0]
        moved = np.convolve(taps, late)
        moved[: len(before)] += before
        out += moved[:count]
    return out


def fitted_free_run(a: ArrayLike, drive: FloatArray, measured: FloatArray) -> FloatArray:
    """Return the free run from the n_a first samples that make it fit best, shape (N,).

    Args:
        a: a_1 …, shape (n_a,).
        drive: by :func:`driven`, shape (N,).
        measured: y, shape (N,).

    Returns:
        Infinite throughout where A is not stable.
    """
    poles = np.append(1.0, a)
    if largest_root(poles) >= 1.0:
        return np.full(len(measured), np.inf)
    starts = np.eye(len(poles) - 1, len(measured))
    passed = lfilter([1.0], poles, np.vstack([starts, drive]), axis=1)
    columns, forced = passed[:-1].T, passed[-1]
    begin = np.linalg.lstsq(columns, measured - forced, rcond=1e-10)[0]
    return np.asarray(forced + columns @ begin)


def step_response(a: ArrayLike, b: ArrayLike, delay: int, samples: int) -> FloatArray:
    """Return the answer to a step of 1 of one input at sample 0, shape (N,).

    Args:
        a: a_1 …, shape (n_a,).
        b: shape (n_b,).
        delay: d, samples.
        samples: N.
    """
    step = (np.arange(samples) > delay).astype(float)
    return filtered(np.asarray(b, dtype=float), np.append(1.0, a), step)
