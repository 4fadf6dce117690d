r"""How likely PV is under each friction, for one process and one noise.

.. math::

    y_k = c_0 + c_1 (1 - e^{-t_k/\tau_1}) + K \sum_i (\Delta\chi_i + \delta_i) s_{k - r_i} + v_k

with the step response s of two lags and a dead time, moves Δχ of the stem at the steps r_i of OP,
and v a load that walks at random behind the first lag, first-order noise and white noise. The walk
of the load and c_1 make a level possible, whose first lag is longer than the record. The moves are
those of a friction law, but for δ: what the law leaves out, and a gain that changes with the
opening. c is flat, K is known from before or has unit information (Kass and Wasserman 1995, Am.
Stat. 90, 928), 1/σ² of the
innovations is flat over log σ; all are integrated out, so that one number compares frictions.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import BoolArray, FloatArray, IntArray
from stiction_ros.identification.valve_test.steps import Steps

OWN_ERROR = 0.05
"""Standard deviation of what a law leaves out of a move, %: an eighth of the smallest friction."""
KNOWN = 0.5
"""Standard deviation of a gain that was known before the test, over it: weak, as such a gain comes
from a record that hardly moves, or from the model of a controller."""
ROUNDING = 1e-12  # share of PV's energy that computing leaves where nothing else does
CURVATURE = math.log(50.0) / 200.0
"""Half the relative change of the gain per % of travel of an equal percentage valve of rangeability
50, the largest that is usual (IEC 60534-2-4)."""
CONVERGED = 1e-12  # relative change of the variance from which on a gain is held


class Dynamics(NamedTuple):
    """Process and noise in numbers that are searched without bounds."""

    lag: float  # log of the first lag over the median hold
    # log-odds of the second lag over the first, or over the hold where that is shorter
    second: float
    # log-odds of the dead time over the median hold, in which PV answers each move: by a dead time
    # of a whole hold each move could be taken for the one before
    dead: float
    # log of the variance of a step of the load over that of white noise; the load counts by what it
    # makes of PV in a hold
    load: float
    kept: float  # log-odds of the share that first-order noise keeps in a sample
    noise: float  # log of its variance over that of white noise


@dataclasses.dataclass(frozen=True)
class Shape:
    """Process and noise in samples."""

    first: float  # first, second, dead: lags and dead time, samples
    second: float
    dead: float
    load: float  # variance of a step of the load
    noise: FloatArray  # share kept in a sample, and variance

    @classmethod
    def of(cls, dynamics: Dynamics, hold: float) -> "Shape":
        """Return them for a median hold of ``hold`` samples."""
        first = hold * math.exp(dynamics.lag)
        late = max(first / hold, 1.0)
        return cls(
            first,
            0.999 * _share(dynamics.second) * min(first, hold),
            hold * _share(dynamics.dead),
            math.exp(dynamics.load) * late**2,
            np.array([_share(dynamics.kept), math.exp(dynamics.noise)]),
        )

    def shown(self, samples: Any) -> FloatArray:
        """Return how much of a step PV shows after some samples, but for the second lag."""
        return np.asarray(-np.expm1(-np.maximum(samples - self.dead, 0.0) / self.first))

    def answers(self, rows: IntArray, count: int) -> FloatArray:
        """Return the answer of both lags to a step at each of ``rows``, (M,), shape (count, M)."""
        since = np.maximum(np.arange(count) - self.dead, 0.0)
        slow, fast = (lag * np.exp(-since / lag) for lag in (self.first, self.second))
        one = 1.0 - (slow - fast) / (self.first - self.second)
        out = np.zeros((count, len(rows)))
        for i, row in enumerate(rows.tolist()):
            out[row:, i] = one[: count - row]
        return out

    def unsure(self, samples: float) -> float:
        """Return the variance of the mean of PV over some samples, load and noise together."""
        kept, variance = self.noise
        held = min((1.0 + kept) / (1.0 - kept) / samples, 1.0)
        return float(1.0 / samples + variance * held + self.load * samples)


def log_sum(logs: FloatArray) -> float:
    """Return log Σ exp of some numbers."""
    most = float(logs.max())
    return most + math.log(float(np.exp(logs - most).sum()))


def _share(odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-odds))


@dataclasses.dataclass(frozen=True)
class Answered:
    """PV and the answers to steps under one process and one noise, made white."""

    gram: FloatArray  # of the answers, shape (M, M)
    beside: FloatArray  # of the answers with PV, shape (M,)
    energy: float  # of PV
    count: int  # samples that count, less those that the two levels take up
    constant: float  # what is added to every log likelihood
    # change of the square of OP, from where it began, at each step, %², shape (M,)
    bend: FloatArray

    @classmethod
    def of(cls, pv: FloatArray, seen: BoolArray, steps: Steps, shape: Shape) -> "Answered":
        """Return them.

        Args:
            pv: shape (N,).
            seen: samples that were measured, shape (N,).
            steps: of OP.
            shape: process and noise.
        """
        answers = shape.answers(steps.rows, len(pv))
        fading = -np.expm1(-np.arange(len(pv)) / shape.first)
        middle = pv - pv[seen].mean()
        columns = np.column_stack([answers, np.ones(len(pv)), fading / fading[-1], middle])
        white, logarithms = white_rows(columns, seen, shape.first, shape.load, shape.noise)
        gram, count = white.T @ white, len(steps.rows)
        levels, others = slice(count, count + 2), np.append(np.arange(count), count + 2)
        within, across = gram[levels, levels], gram[levels][:, others]
        rest = gram[np.ix_(others, others)] - across.T @ np.linalg.solve(within, across)
        return cls(
            rest[:-1, :-1],
            rest[:-1, -1],
            float(rest[-1, -1]),
            len(white) - 2,
            -logarithms - 0.5 * float(np.linalg.slogdet(within)[1]),
            np.diff((steps.levels - steps.levels[0]) ** 2),
        )

    def likelihoods(
        self, moves: FloatArray, gain: float | None
    ) -> tuple[FloatArray, FloatArray, float]:
        """Return the log likelihood of moves of the stem, K, (U,) each, and σ of the best.

        Args:
            moves: at each step of OP, %, shape (U, M).
            gain: K as it was known before; None where it was not.
        """
        with_pv, across = moves @ self.beside, moves @ self.gram
        own, energy = _sums(across, moves), self.energy
        variance = max(energy - float((with_pv**2 / own).max()), 1e-300) / self.count
        told = None if not gain else variance / (KNOWN * gain) ** 2
        moved = moves.any(axis=1)
        found, gains, left = self._found(with_pv, own, energy, told, gain or 0.0)
        spread = self._spread(_likely(gains[moved], found[moved]) ** 2 / variance)
        inner = np.linalg.inv(np.eye(len(spread)) + spread @ self.gram)
        taken = inner @ spread
        with_pv = with_pv - across @ (taken @ self.beside)
        own = _sums(across, moves - across @ taken)
        energy -= float(self.beside @ taken @ self.beside)
        found, gains, left = self._found(with_pv, own, energy, told, gain or 0.0)
        found += 0.5 * np.linalg.slogdet(inner)[1]
        found[~moved] = -0.5 * self.count * math.log(self.energy)
        noise = math.sqrt(float(left[np.argmax(found)]) / self.count)
        return self.constant + found, gains, noise

    def _found(
        self, with_pv: FloatArray, own: FloatArray, energy: float, told: float | None, known: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log likelihoods, K and what is left of the energy, (U,) each.

        Args:
            with_pv, own: products of the moves' answers with PV and themselves, shape (U,).
            energy: of PV.
            told: precision of the K known before over that of PV; None for unit information.
            known: that K.
        """
        tells = own / self.count if told is None else np.full(len(own), told)
        gains = (with_pv + tells * known) / (own + tells)
        left = energy + tells * known**2 - (with_pv + tells * known) * gains
        left = np.maximum(left, ROUNDING * self.energy)
        found = -0.5 * self.count * np.log(left) + 0.5 * np.log(tells / (own + tells))
        return found, gains, left

    def _spread(self, scale: float) -> FloatArray:
        """Return the covariance of δ K / σ, shape (M, M)."""
        own = OWN_ERROR**2 * np.eye(len(self.bend))
        return np.asarray(scale * (own + CURVATURE**2 * np.outer(self.bend, self.bend)))


def _sums(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the sum of the products of each two rows, above 0, shape (U,)."""
    return np.asarray(np.maximum(np.einsum("ij,ij->i", one, other), 1e-300))


def _likely(gains: FloatArray, found: FloatArray) -> float:
    """Return the geometric mean of |K| by how likely each is; 0 where the stem never moves.

    Where PV shows a single slip, any size of it is as likely with K in proportion: the best of
    them would be chance.
    """
    if not len(found):
        return 0.0
    weights = np.exp(found - log_sum(found))
    return float(np.exp(weights @ np.log(np.maximum(np.abs(gains), 1e-300))))


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
