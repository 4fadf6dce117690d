"""White noise beside a first-order one: two figures that remember longer than any short order."""

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.measures import NEGLIGIBLE, STEPS
from stiction_ros.effects.behaviour import BoolArray, FloatArray

REMEMBERED = 60  # samples that such a noise, or an OP off its record, is remembered
BEGUN = ((0.98, 0.5), (0.98, 0.9))  # from which it is looked for: the white part small, and large
FIGURES = len(BEGUN[0])


def counting(ar: FloatArray) -> FloatArray:
    """Return φ without those at the end that together do not count.

    A slow noise is remembered a little at each of many lags, which together are much.
    """
    rest = np.cumsum(np.abs(ar)[::-1])[::-1]
    return ar[: int(np.sum(rest > NEGLIGIBLE))]


def slow_beside_white(residual: FloatArray, rows: BoolArray) -> FloatArray:
    r"""Return φ of white noise beside a first-order one, by least squares of its innovations.

    .. math::
        r_k = c r_{k-1} + e_k - \theta e_{k-1}, \quad
        \varphi_i = (c - \theta) \theta^{i-1}

    Args:
        residual: r, shape (N,).
        rows: whose innovations count, shape (N,).
    """
    _, keep, forget = min(_searched(residual, rows, *start) for start in BEGUN)
    return counting(np.asarray((keep - forget) * forget ** np.arange(REMEMBERED), dtype=float))


@compiled
def _searched(
    residual: FloatArray, rows: BoolArray, keep: float, forget: float
) -> tuple[float, float, float]:
    """Return the sum of squares and both poles at their best, from a start."""
    best, own, other = np.inf, keep, forget
    most = 1.0 - 1.0 / len(residual)  # of either pole: a walk that goes on for all samples
    share = 1.0
    step = np.zeros(2)
    for _ in range(STEPS):
        left = total = 0.0
        slope, cross, gram = np.zeros(2), np.zeros(2), np.zeros((2, 2))
        for k in range(1, len(residual)):
            slope[0] = forget * slope[0] - residual[k - 1]
            slope[1] = forget * slope[1] + left
            left = residual[k] - keep * residual[k - 1] + forget * left
            if rows[k]:
                total += left * left
                for i in range(2):
                    cross[i] += slope[i] * left
                    for j in range(2):
                        gram[i, j] += slope[i] * slope[j]
        before = best
        if total < best:
            best, own, other, share = total, keep, forget, 1.0
            least = gram[0, 0] * gram[1, 1] - gram[0, 1] * gram[1, 0]
            if not least > 0.0:
                break
            step[0] = (gram[0, 1] * cross[1] - gram[1, 1] * cross[0]) / least
            step[1] = (gram[1, 0] * cross[0] - gram[0, 0] * cross[1]) / least
            if before - best < 1e-9 * best:
                break
        else:
            share *= 0.5
        keep = min(max(own + share * step[0], -most), most)
        forget = min(max(other + share * step[1], -most), most)
    return best, own, other
