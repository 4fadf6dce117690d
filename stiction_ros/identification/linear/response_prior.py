r"""What is known of a process before the record: its impulse response is smooth and dies away.

.. math:: h \sim N(0, \sigma^2 K), \qquad K_{ij} = c\, \lambda^{\max(i, j)}, \quad 0 < \lambda < 1

the *tuned/correlated* kernel of Chen, Ohlsson and Ljung (Automatica 48, 2012). Neither an order
nor a delay has to be chosen: taps that the record does not need stay near zero. With the
differences :math:`g_i = h_i - h_{i+1}`, :math:`g_M = h_M`, the prior is a product of independent
normal distributions, so the inverse of K is tridiagonal and its determinant a product.
"""

import dataclasses
import functools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray

DECAYS = (0.6, 0.75, 0.85, 0.92, 0.96, 0.98)  # per tap: a time constant of 2 to 50 taps
WAVES = tuple(10.0**k for k in range(-2, 9))
"""Of σ²: of the first harmonic of a wave from outside, in PV."""
SHARPNESSES = (2.0, 4.0, 6.0)
"""Powers by which the variances of harmonics fall: squares, triangles, and smoother."""
SIZES = (1e-2, 1e-1, 1.0, 10.0, 100.0, 1e3, 1e4)  # of σ²; per standard deviation of the stem
FREE = -1  # reach of a response of which nothing is held
FACTOR = 3.0  # from one reach to the next: a standard deviation of its logarithm
REACHES = range(-3, 4)  # powers of it
MIDDLE = 0.9  # the reach itself, in units of what is expected
TIGHT = 1e6  # 1 / variance with which a reach is held, over that of the prior


@dataclasses.dataclass(frozen=True)
class Reach:
    """How far a response gets is known but for a factor."""

    valve: int  # index of the one whose response it is
    heights: FloatArray  # what sums its groups of taps up, shape (r,)
    unit: float  # the sum that is expected


@dataclasses.dataclass(frozen=True)
class Held:
    """A response whose sum is held, as one more row of the equations for it."""

    precision: FloatArray  # that it adds, shape (r, r)
    pull: FloatArray  # that it adds to the products with the output, shape (r,)
    energy: float  # that it adds to the output's
    determinant: float  # that it adds to −2 log likelihood


@dataclasses.dataclass(frozen=True)
class ResponsePrior:
    """One member of the family."""

    decay: int = 3  # index of λ in ``DECAYS``
    size: int = 2  # index of c in ``SIZES``
    # wave, sharpness: indices in ``WAVES`` and ``SHARPNESSES``; they count where there is a wave
    wave: int = 5
    sharpness: int = 1
    # index in ``REACHES``, or ``FREE``; it counts where one is expected
    reach: int = len(REACHES) // 2

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
        return _inverse(self.decay, self.size, edges.tobytes())[0]

    def log_determinant(self, edges: IntArray) -> float:
        """Return log det K."""
        return _inverse(self.decay, self.size, edges.tobytes())[1]

    def wave_variances(self, harmonics: IntArray) -> FloatArray:
        """Return the variances of a wave's harmonics, numbered from 1, over σ², same shape."""
        return np.asarray(WAVES[self.wave] * harmonics ** -SHARPNESSES[self.sharpness])

    def held(self, edges: IntArray, reach: Reach) -> Held:
        """Return the response that is held to the reach of this prior.

        The likelihood is that of the output given the sum; how likely the sum is comes on top.

        Args:
            edges: of groups of taps, shape (r + 1,).
            reach: what is expected.
        """
        heights = reach.heights.tobytes()
        return _held(self.decay, self.size, self.reach, edges.tobytes(), heights, reach.unit)

    def neighbours(self, *, waves: bool = False) -> "list[ResponsePrior]":
        """Return the members next to this one, itself included; ``waves`` changes those of it."""
        if waves:
            return [
                dataclasses.replace(self, wave=wave, sharpness=sharpness)
                for wave in _near(self.wave, len(WAVES))
                for sharpness in _near(self.sharpness, len(SHARPNESSES))
            ]
        return [
            dataclasses.replace(self, decay=decay, size=size)
            for decay in _near(self.decay, len(DECAYS))
            for size in _near(self.size, len(SIZES))
        ]


def _near(index: int, count: int) -> range:
    return range(max(index - 1, 0), min(index + 2, count))


@functools.lru_cache(maxsize=1024)
def _inverse(decay: int, size: int, edges: bytes) -> tuple[FloatArray, float]:
    """Return the inverse of K and log det K: few priors and groups serve a whole search."""
    variances = ResponsePrior(decay, size).variances(np.frombuffer(edges, dtype=np.int64))
    weights = 1.0 / variances
    found = np.diag(weights + np.append(0.0, weights[:-1]))
    found -= np.diag(weights[:-1], 1) + np.diag(weights[:-1], -1)
    found.flags.writeable = False
    return found, float(np.log(variances).sum())


@functools.lru_cache(maxsize=4096)
def _held(decay: int, size: int, reach: int, edges: bytes, heights: bytes, unit: float) -> Held:
    """Return the response that is held, what it adds not to be written to."""
    told = np.frombuffer(heights, dtype=np.float64)
    if reach == FREE:
        unlikely = float(max(REACHES)) ** 2
        return Held(np.zeros((len(told), len(told))), np.zeros(len(told)), 0.0, unlikely)
    power = REACHES[reach]
    goal = MIDDLE * FACTOR**power * unit
    spread = float(told @ np.linalg.solve(_inverse(decay, size, edges)[0], told))
    weight = TIGHT / spread
    energy = weight * goal**2 - goal**2 / (spread + 1.0 / weight)
    determinant = float(power**2 - np.log1p(TIGHT))
    return Held(weight * np.outer(told, told), weight * goal * told, energy, determinant)
