"""Compiled: rows made white under load and noise."""

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import BoolArray, FloatArray

CONVERGED = 1e-12  # relative change of the variance from which on a gain is held


@compiled
def white_rows(
    values: FloatArray, seen: BoolArray, lag: float, load: float, noise: FloatArray
) -> tuple[FloatArray, float]:
    """Return the innovations of rows over their standard deviation, and the sum of its logarithms.

    A load that walks at random acts behind a first-order lag; PV shows that, first-order noise,
    and white noise of variance 1.

    Args:
        values: a signal in each column, shape (N, C).
        seen: samples that count, shape (N,).
        lag: samples.
        load: variance of a step of the walk.
        noise: share that first-order noise keeps from sample to sample, and its variance.

    Returns:
        Shape (n, C) with one row for each sample that counts, and Σ ln √F.
    """
    pole = np.exp(-1.0 / lag)
    enters = 1.0 - pole
    kept, variance = noise[0], noise[1]
    count, signals = values.shape
    state = np.zeros((3, signals))
    p = np.zeros((3, 3))
    p[2, 2] = variance
    out = np.empty((int(seen.sum()), signals))
    total, at, before = 0.0, 0, 0.0
    g0 = g1 = g2 = root = logarithm = 0.0
    steady = False
    for k in range(count):
        if seen[k]:
            if not steady:
                c0, c1, c2 = p[0, 0] + p[0, 2], p[1, 0] + p[1, 2], p[2, 0] + p[2, 2]
                f = c0 + c2 + 1.0
                g0, g1, g2 = c0 / f, c1 / f, c2 / f
                root, logarithm = 1.0 / np.sqrt(f), 0.5 * np.log(f)
            for j in range(signals):
                e = values[k, j] - state[0, j] - state[2, j]
                out[at, j] = e * root
                state[0, j] += g0 * e
                state[1, j] += g1 * e
                state[2, j] += g2 * e
            total += logarithm
            at += 1
            if not steady:
                p[0, 0] -= g0 * c0
                p[0, 1] -= g0 * c1
                p[0, 2] -= g0 * c2
                p[1, 1] -= g1 * c1
                p[1, 2] -= g1 * c2
                p[2, 2] -= g2 * c2
        elif steady:
            # The variance is that before a sample that was seen; here none is.
            steady = False
        for j in range(signals):
            state[0, j] = pole * state[0, j] + enters * state[1, j]
            state[2, j] *= kept
        if not steady:
            x0 = pole * p[0, 0] + enters * p[0, 1]
            x1 = pole * p[0, 1] + enters * p[1, 1]
            x2 = pole * p[0, 2] + enters * p[1, 2]
            p[0, 0] = pole * x0 + enters * x1
            p[0, 1] = x1
            p[0, 2] = kept * x2
            p[1, 1] += load
            p[1, 2] *= kept
            p[2, 2] = kept * kept * p[2, 2] + (1.0 - kept * kept) * variance
            p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]
            now = p[0, 0] + 2.0 * p[0, 2] + p[2, 2]
            steady = seen[k] and abs(now - before) <= CONVERGED * (1.0 + now)
            before = now
    return out, total
