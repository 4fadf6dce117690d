r"""What is known of a process before the record: its impulse response is smooth and dies away.

.. math:: h \sim N(0, \sigma^2 K), \qquad K_{ij} = c\, \lambda^{\max(i, j)}, \quad 0 < \lambda < 1

the *tuned/correlated* kernel of Chen, Ohlsson and Ljung (Automatica 48, 2012). Neither an order
nor a delay has to be chosen: taps that the record does not need stay near zero. With the
differences :math:`g_i = h_i - h_{i+1}`, :math:`g_M = h_M`, the prior is a product of independent
normal distributions, so the inverse of K is tridiagonal and its determinant a product.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray

DECAYS = (0.6, 0.75, 0.85, 0.92, 0.96, 0.98)  # per tap: a time constant of 2 to 50 taps
SIZES = (1e-2, 1e-1, 1.0, 10.0, 100.0, 1e3, 1e4)  # of σ²; per standard deviation of the stem


@dataclasses.dataclass(frozen=True)
class ResponsePrior:
    """One member of the family.

    Attributes:
        decay: index of λ in :data:`DECAYS`.
        size: index of c in :data:`SIZES`.
    """

    decay: int = 3
    size: int = 2

    def variances(self, edges: IntArray) -> FloatArray:
        """Return the variances of the differences g over σ², shape (r,).

        Args:
            edges: of groups of taps, each as high as its middle one, shape (r + 1,).
        """
        middles = 0.5 * (edges[:-1] + 1 + edges[1:])
        powers = SIZES[self.size] * DECAYS[self.decay] ** middles
        return np.append(powers[:-1] - powers[1:], powers[-1])

    def precision(self, edges: IntArray) -> FloatArray:
        """Return the inverse of K, shape (r, r), not to be written to."""
        return _inverse(self, edges.tobytes())[0]

    def log_determinant(self, edges: IntArray) -> float:
        """Return log det K."""
        return _inverse(self, edges.tobytes())[1]

    def neighbours(self) -> list[ResponsePrior]:
        """Return the members next to this one, itself included."""
        return [
            ResponsePrior(decay, size)
            for decay in range(max(self.decay - 1, 0), min(self.decay + 2, len(DECAYS)))
            for size in range(max(self.size - 1, 0), min(self.size + 2, len(SIZES)))
        ]


@functools.lru_cache(maxsize=1024)
def _inverse(prior: ResponsePrior, edges: bytes) -> tuple[FloatArray, float]:
    """Return the inverse of K and log det K: few priors and groups serve a whole search."""
    variances = prior.variances(np.frombuffer(edges, dtype=np.int64))
    weights = 1.0 / variances
    found = np.diag(weights + np.append(0.0, weights[:-1]))
    found -= np.diag(weights[:-1], 1) + np.diag(weights[:-1], -1)
    found.flags.writeable = False
    return found, float(np.log(variances).sum())
