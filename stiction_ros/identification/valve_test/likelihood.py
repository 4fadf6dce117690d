r"""How likely PV is under each friction, for one process and one noise.

.. math::

    y_k = c_0 + c_1 (1 - e^{-t_k/\tau_1}) + K \sum_i (\Delta\chi_i + \delta_i) s_{k - r_i} + v_k

with the step response s of two lags and a dead time, moves Δχ of the stem at the steps r_i of OP,
and v a load that walks at random behind the first lag, first-order noise and white noise. The walk
of the load and c_1 make a level possible, whose first lag is longer than the record. The moves are
those of a friction law, but for δ: what the law leaves out, and a gain that changes with the
opening. c is flat, K has unit information (Kass and Wasserman 1995, Am. Stat. 90, 928), 1/σ² of the
innovations is flat over log σ; all are integrated out, so that one number compares frictions.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.identification.valve_test.step_kernels import step_answers, white_rows
from stiction_ros.identification.valve_test.steps import Steps

OWN_ERROR = 0.05
"""Standard deviation of what a law leaves out of a move, %: an eighth of the smallest friction."""
ROUNDING = 1e-14  # share of PV's energy that computing leaves where nothing else does
CURVATURE = math.log(50.0) / 200.0
"""Half the relative change of the gain per % of travel of an equal percentage valve of rangeability
50, the largest that is usual (IEC 60534-2-4)."""


class Dynamics(NamedTuple):
    """Process and noise in numbers that are searched without bounds.

    Attributes:
        lag: log of the first lag over the median hold.
        second: log-odds of the second lag over the first, or over the hold where that is shorter.
        dead: log of the dead time over the median hold.
        load: log of the variance of a step of the load over that of white noise; the load counts
            by what it makes of PV in a hold.
        kept: log-odds of the share that first-order noise keeps in a sample.
        noise: log of its variance over that of white noise.
    """

    lag: float
    second: float
    dead: float
    load: float
    kept: float
    noise: float


@dataclasses.dataclass(frozen=True)
class Shape:
    """Process and noise in samples.

    Attributes:
        first, second, dead: lags and dead time, samples.
        load: variance of a step of the load.
        noise: share kept in a sample, and variance.
    """

    first: float
    second: float
    dead: float
    load: float
    noise: FloatArray

    @classmethod
    def of(cls, dynamics: Dynamics, hold: float) -> Shape:
        """Return them for a median hold of ``hold`` samples."""
        first = hold * math.exp(dynamics.lag)
        late = max(first / hold, 1.0)
        return cls(
            first,
            0.999 * _share(dynamics.second) * min(first, hold),
            hold * math.exp(dynamics.dead),
            math.exp(dynamics.load) * late**2,
            np.array([_share(dynamics.kept), math.exp(dynamics.noise)]),
        )

    def shown(self, samples: float) -> float:
        """Return how much of a step PV shows after some samples, but for the second lag."""
        return -math.expm1(-max(samples - self.dead, 0.0) / self.first)


def log_sum(logs: FloatArray) -> float:
    """Return log Σ exp of some numbers."""
    most = float(logs.max())
    return most + math.log(float(np.exp(logs - most).sum()))


def _share(odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-odds))


@dataclasses.dataclass(frozen=True)
class Answered:
    """PV and the answers to steps under one process and one noise, made white.

    Attributes:
        gram: of the answers, shape (M, M).
        beside: of the answers with PV, shape (M,).
        energy: of PV.
        count: samples that count, less those that the two levels take up.
        constant: what is added to every log likelihood.
        bend: change of the square of OP, from where it began, at each step, %², shape (M,).
    """

    gram: FloatArray
    beside: FloatArray
    energy: float
    count: int
    constant: float
    bend: FloatArray

    @classmethod
    def of(cls, pv: FloatArray, seen: BoolArray, steps: Steps, shape: Shape) -> Answered:
        """Return them.

        Args:
            pv: shape (N,).
            seen: samples that were measured, shape (N,).
            steps: of OP.
            shape: process and noise.
        """
        answers = step_answers(steps.rows, len(pv), shape.first, shape.second, shape.dead)
        fading = -np.expm1(-np.arange(len(pv)) / shape.first)
        columns = np.column_stack([answers, np.ones(len(pv)), fading / fading[-1], pv])
        white, logarithms = white_rows(columns, seen, shape.first, shape.load, shape.noise)
        q, r = np.linalg.qr(white[:, -3:-1])
        white -= q @ (q.T @ white)
        moves, y = white[:, :-3], white[:, -1]
        determinant = float(np.log(np.abs(np.diag(r))).sum())
        lead = steps.levels - steps.levels[0]
        return cls(
            moves.T @ moves,
            moves.T @ y,
            float(y @ y),
            len(y) - 2,
            -logarithms - determinant,
            np.diff(lead**2),
        )

    def likelihoods(self, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the log likelihood of moves of the stem, and K, shape (U,) each.

        Args:
            moves: at each step of OP, %, shape (U, M).
        """
        with_pv, own = moves @ self.beside, _forms(moves, self.gram)
        best = int(np.argmax(with_pv**2 / own))
        variance = max(self.energy - with_pv[best] ** 2 / own[best], 1e-300) / self.count
        spread = self._spread((with_pv[best] / own[best]) ** 2 / variance)
        inner = np.linalg.inv(np.eye(len(spread)) + spread @ self.gram)
        taken = inner @ spread
        with_pv = moves @ (self.beside - self.gram @ (taken @ self.beside))
        own = _forms(moves, self.gram - self.gram @ taken @ self.gram)
        energy = self.energy - float(self.beside @ taken @ self.beside)
        left = energy - with_pv**2 / own * (self.count / (self.count + 1.0))
        left = np.maximum(left, ROUNDING * self.energy)
        half = 0.5 * self.count
        found = -half * np.log(left) - 0.5 * math.log1p(self.count)
        found += 0.5 * np.linalg.slogdet(inner)[1]
        found[~moves.any(axis=1)] = -half * math.log(self.energy)
        return self.constant + found, with_pv / own

    def _spread(self, scale: float) -> FloatArray:
        """Return the covariance of δ K / σ, shape (M, M)."""
        own = OWN_ERROR**2 * np.eye(len(self.bend))
        return np.asarray(scale * (own + CURVATURE**2 * np.outer(self.bend, self.bend)))


def _forms(rows: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return x A x of each row x, above 0, shape (U,)."""
    return np.asarray(np.maximum(np.einsum("ij,ij->i", rows @ matrix, rows), 1e-300))
