r"""How PV answers stems, from what each sample adds to the ones before.

.. math:: y_k = c + \sum_{i=1}^{n} f_i y_{k-i}
          + \sum_j \sum_{i=1}^{n} g^{(j)}_i \chi^{(j)}_{k-i-d_j} + w_k + \epsilon_k

What a loop does when something in it is changed is told by what comes from outside, and that is
ε: what nobody could have known a sample before. What a process of low order, run freely, leaves of
PV is not from outside: the part of a cycle that such a process misses is in it, and would
stay when the cycle goes. In a closed loop ε alone is independent of OP and stem, so that f and g
are right however the loop is closed; processes that integrate and noise of any colour are among
them. No order is chosen: f and g are smooth and die away, by the prior of
:mod:`stiction_ros.identification.linear.response_prior`, whose size and decay are those under which
the record is likeliest. w is a wave from outside, where one is believed: it keeps its own time, and
without it f and g would ring at its period.
"""

import dataclasses
import functools
from collections.abc import Iterator

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.signals.arx import arx_columns
from stiction_ros.signals.spectral_lines import LEAST_PER_HARMONIC

LAGS = 30
"""n, at most."""

SHARE = 12
"""Samples for each lag, at least."""

LATE = 10
"""Samples of a dead time that the lags hold; what is longer is left out of them."""

DECAYS = (0.5, 0.65, 0.75, 0.85, 0.92, 0.96)
"""Of the prior, per lag."""

SIZES = tuple(10.0**k for k in range(-3, 10))
"""Of the prior: variance of the first lag over that of ε."""

FREE = 1e-6
"""Inverse variance of the constant and of waves, over that of ε: nothing is known of them."""

BEGUN = (3, 6, 3, 5)
"""Indices of decay and size, of f and of g, at which the search begins."""

WAVE_GAIN = 6.0
"""−2 log likelihood that a wave must gain to be taken."""

Prior = tuple[int, int, int, int]


@dataclasses.dataclass(frozen=True)
class Answer:
    """Equation of one output as the record tells it, signals scaled."""

    mean: FloatArray  # of f, g of each valve, the constant and waves, shape (q,)
    # Cholesky factor of the inverse covariance over the variance of ε, shape (q, q)
    factor: FloatArray
    variance: float  # of ε
    lags: int  # n
    valves: int  # m

    def drawn(self, random: np.random.Generator) -> FloatArray:
        """Return another equation that the record does not tell from this one, shape (q,)."""
        apart = np.linalg.solve(self.factor.T, random.standard_normal(len(self.mean)))
        return np.asarray(self.mean + np.sqrt(self.variance) * apart)

    def split(self, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return a_1 … a_n, sign as in (8a), and b of each valve, shape (m, n)."""
        n = self.lags
        return -weights[:n], weights[n : n * (1 + self.valves)].reshape(self.valves, n)


@dataclasses.dataclass(frozen=True)
class Answering:
    """One output to be explained by its past and by stems."""

    pv: FloatArray  # shape (N,)
    delay: IntArray  # d_j, samples, shape (m,)
    wave: FloatArray  # sines and cosines of a wave from outside, shape (N, 2 H); H may be 0
    lags: int  # n
    prior: Prior = BEGUN  # that is used

    @classmethod
    def of(
        cls, pv: FloatArray, stems: FloatArray, dead_times: IntArray, frequencies: FloatArray
    ) -> "Answering":
        """Choose prior and wave for the likeliest stems.

        Args:
            pv: shape (N,).
            stems: shape (N, m).
            dead_times: as identified, samples, shape (m,).
            frequencies: of the lines of a wave that there may be, turns per sample, shape (H,).
        """
        count = len(pv)
        lags = max(min(LAGS, count // SHARE), 1)
        delay = np.maximum(dead_times - min(LATE, lags // 2), 0)
        plain = cls(pv, delay, np.zeros((count, 0)), lags)
        loss, plain = plain._tuned(stems)
        lines = frequencies[frequencies * LEAST_PER_HARMONIC < 1.0]
        if not len(lines):
            return plain
        angle = 2.0 * np.pi * np.outer(np.arange(count), lines)
        wave = np.concatenate([np.sin(angle), np.cos(angle)], axis=1)
        beside_loss, beside = dataclasses.replace(plain, wave=wave)._tuned(stems)
        return beside if beside_loss < loss - WAVE_GAIN else plain

    @property
    def past(self) -> int:
        """Samples before the first that is explained."""
        return self.lags + int(self.delay.max(initial=0))

    def fit(self, stems: FloatArray) -> Answer:
        """Return the equation for stems, shape (N, m)."""
        return self._solved(self._products(stems), self.prior)[1]

    def loss(self, stems: FloatArray) -> float:
        """Return −2 log of the likelihood of stems, shape (N, m), up to a constant."""
        return self._solved(self._products(stems), self.prior)[0]

    def left(self, stems: FloatArray, weights: FloatArray) -> FloatArray:
        """Return what a past and stems do not tell, shape (N,); 0 where the past is not known.

        Args:
            stems: shape (N, m).
            weights: of the equation, shape (q,); its constant and waves are not told.
        """
        columns, out = self._columns(stems), self.pv[self.past :].copy()
        for k in np.arange(len(columns)).reshape(-1, self.lags).T.ravel():  # lag by lag
            out -= weights[k] * columns[k]
        return np.append(np.zeros(self.past), out)

    def _columns(self, stems: FloatArray) -> list[FloatArray]:
        """Return PV and stems at all lags behind the past, shape (N − past,) each."""
        orders = self.lags, self.lags
        return arx_columns(self.pv, stems.T, self.delay.tolist(), orders, self.past)

    def _products(self, stems: FloatArray) -> tuple[FloatArray, FloatArray, float, int]:
        """Return all sums over rows that a solution takes, and the number of rows."""
        seen, wave = self.pv[self.past :], self.wave[self.past :]
        table = np.column_stack([*self._columns(stems), np.ones(len(seen)), wave])
        return table.T @ table, table.T @ seen, float(seen @ seen), len(seen)

    def _tuned(self, stems: FloatArray) -> "tuple[float, Answering]":
        """Return −2 log of the likelihood of the best prior, downhill, and that prior in use."""
        products = self._products(stems)
        met: dict[Prior, float] = {}

        def loss(prior: Prior) -> float:
            if prior not in met:
                met[prior] = self._solved(products, prior)[0]
            return met[prior]

        prior = self.prior
        while (better := min(_near(prior), key=loss)) != prior:
            prior = better
        return loss(prior), dataclasses.replace(self, prior=prior)

    def _solved(
        self, products: tuple[FloatArray, FloatArray, float, int], prior: Prior
    ) -> tuple[float, Answer]:
        """Return −2 log of the marginal likelihood, up to a constant, and the equation."""
        n, valves = self.lags, len(self.delay)
        gram, side, energy, count = products
        precision, determinant = gram.copy(), 0.0
        for part in range(1 + valves):
            decay, size = prior[:2] if part == 0 else prior[2:]
            inverse, log_determinant = _prior(decay, n)
            block = slice(n * part, n * (part + 1))
            precision[block, block] += inverse / SIZES[size]
            determinant += log_determinant + n * np.log(SIZES[size])
        free = np.arange(n * (1 + valves), len(precision))
        precision[free, free] += FREE
        determinant -= len(free) * np.log(FREE)
        factor = np.asarray(np.linalg.cholesky(precision), dtype=np.float64)
        half = np.linalg.solve(factor, side)
        variance = max(energy - float(half @ half), 1e-12 * energy) / count
        determinant += 2.0 * float(np.log(np.diag(factor)).sum())
        mean = np.linalg.solve(factor.T, half)
        answer = Answer(mean, factor, variance, n, valves)
        return count * np.log(variance) + determinant, answer


def _near(prior: Prior) -> Iterator[Prior]:
    """Yield a prior and those next to it."""
    yield prior
    for place, index in enumerate(prior):
        last = len(DECAYS if place % 2 == 0 else SIZES) - 1
        for other in (index - 1, index + 1):
            if 0 <= other <= last:
                changed = list(prior)
                changed[place] = other
                yield changed[0], changed[1], changed[2], changed[3]


@functools.cache
def _prior(decay: int, count: int) -> tuple[FloatArray, float]:
    """Return the inverse of λ^max(i, j), shape (n, n), not to be written to, and log det of it."""
    powers = DECAYS[decay] ** np.arange(1.0, count + 1)
    variances = np.append(powers[:-1] - powers[1:], powers[-1])
    differences = np.eye(count) - np.eye(count, k=1)
    return (differences.T / variances) @ differences, float(np.log(variances).sum())
