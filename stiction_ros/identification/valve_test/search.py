"""The evidence of each hypothesis, process and noise searched for each by itself."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from stiction_ros.deferred import halton_sequence
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.identification.valve_test.frictions import LEVELS, Frictions
from stiction_ros.identification.valve_test.likelihood import (
    Answered,
    Dynamics,
    Shape,
    log_sum,
)
from stiction_ros.identification.valve_test.steps import Steps

EVALUATIONS = 150
"""Of a search over process and noise."""
DRAWS = 64
"""Of process and noise, over which frictions are averaged."""
CURVED = 0.1
"""Share of the width of the prior by which the evidence is differenced."""
COLD, WARM = 0.7, 0.3
"""First steps of a search over the width of the prior: from its middle, and from a former end."""


@dataclasses.dataclass(frozen=True)
class Known:
    """What is known of process and noise before a test.

    A test is held for about a dead time and one or two lags; the noise is known to a decade.

    Attributes:
        start, wide: middle and standard deviation of the prior.
        gain: what 1 % of the stem makes of PV within a hold, engineering units, sign included; None
            where it is not known.
    """

    start: Dynamics
    wide: Dynamics
    gain: float | None = None

    @classmethod
    def of(cls, gain: float | None = None, settles: bool | None = None) -> Known:
        """Return it; ``settles`` tells whether PV does, as that of a level does not."""
        lag, wide = {None: (-0.5, 1.7), True: (-0.7, 0.8), False: (3.0, 1.0)}[settles]
        return cls(
            Dynamics(lag, -1.0, -1.5, load=-5.0, kept=0.0, noise=-2.0),
            Dynamics(wide, 1.5, 1.0, load=2.0, kept=1.5, noise=2.0),
            gain,
        )

    def log_prior(self, dynamics: Dynamics) -> float:
        """Return the logarithm of the prior, but for a constant."""
        told = zip(dynamics, self.start, self.wide, strict=True)
        return -0.5 * sum(((v - s) / w) ** 2 for v, s, w in told)

    def gain_of(self, shape: Shape, hold: float) -> tuple[float, float] | None:
        """Return mean and standard deviation of K."""
        if not self.gain:
            return None
        within = max(-np.expm1(-hold / shape.first), 1e-12)
        return self.gain / within, SPREAD * abs(self.gain) / within


SPREAD = 0.7
"""Of a gain identified in a loop whose valve may stick, as a share of it."""


@dataclasses.dataclass(frozen=True)
class Explanation:
    """Friction, or none, at its best process and noise.

    Attributes:
        evidence: log of how likely the record is.
        dynamics: process and noise.
        logs: log of how likely it is with each cell of frictions, prior included, shape (G,).
        gains: K of each.
    """

    evidence: float
    dynamics: Dynamics
    logs: FloatArray
    gains: FloatArray


@dataclasses.dataclass(frozen=True)
class Trial:
    """A record of steps that is searched.

    Attributes:
        pv: shape (N,).
        seen: samples that were measured, shape (N,).
        steps: of OP.
        known: before it.
    """

    pv: FloatArray
    seen: BoolArray
    steps: Steps
    known: Known

    @functools.cached_property
    def hold(self) -> float:
        """Median of the holds between steps, samples."""
        return float(np.median(self.steps.holds[1:]))

    def at(self, dynamics: Dynamics, asked: Frictions | FloatArray) -> Explanation:
        """Return what one process and one noise explain.

        Args:
            dynamics: process and noise.
            asked: frictions, or moves of the stem, %, shape (G, M).
        """
        shape = Shape.of(dynamics, self.hold)
        answered = Answered.of(self.pv, self.seen, self.steps, shape)
        prior = self.known.log_prior(dynamics)
        moves = asked.moves if isinstance(asked, Frictions) else asked
        values, gains = answered.likelihoods(moves, self.known.gain_of(shape, self.hold))
        if isinstance(asked, Frictions):
            values, gains = values[asked.which] + asked.logs, gains[asked.which]
        return Explanation(log_sum(prior + values), dynamics, prior + values, gains)

    def explained(self) -> tuple[Explanation, Explanation, Explanation, Frictions]:
        """Return how an ideal valve, a PV that OP does not move, and friction explain the record.

        Each search also begins where another ended, as each may miss the best process.
        """
        moves, still = np.diff(self.steps.levels)[None], np.zeros((1, len(self.steps.rows)))
        cold = self.known.start
        frictions = Frictions.all(self.steps)
        ideal = self._best((cold,), moves)
        sticky = self._best((cold, ideal.dynamics), frictions)
        for _ in range(2):
            for _ in range(LEVELS):
                frictions = frictions.refined(self.steps, sticky.logs)
                sticky = self.at(sticky.dynamics, frictions)
            sticky = self._best((sticky.dynamics,), frictions)
        ideal = max(ideal, self._best((sticky.dynamics,), moves), key=lambda one: one.evidence)
        return ideal, self._best((cold,), still), self._averaged(sticky, frictions), frictions

    def _averaged(self, best: Explanation, asked: Frictions) -> Explanation:
        """Return the best explanation, each friction averaged over process and noise.

        By importance sampling about the best, as wide in each direction as the evidence is there.
        The evidence stays that of the best, as that of what it is compared with.
        """
        middle, most = np.array(best.dynamics), best.evidence
        wide = np.array(self.known.wide)
        spread = wide.copy()
        for i, step in enumerate(np.diag(CURVED * wide)):
            sides = (self.at(Dynamics(*(middle + way * step)), asked) for way in (-1.0, 1.0))
            fall = most - 0.5 * sum(side.evidence for side in sides)
            spread[i] = min(wide[i], CURVED * wide[i] / math.sqrt(max(2.0 * fall, 1e-3)))
        points = ndtri(halton_sequence(len(middle), seed=0).random(DRAWS))
        weights = 0.5 * (points**2).sum(axis=1)
        logs = np.full(len(best.logs), -np.inf)
        for point, weight in zip(points, weights, strict=True):
            one = self.at(Dynamics(*(middle + spread * point)), asked)
            logs = np.logaddexp(logs, one.logs + weight)
        return dataclasses.replace(best, logs=logs + (best.evidence - log_sum(logs)))

    def _best(self, begins: Sequence[Dynamics], asked: Frictions | FloatArray) -> Explanation:
        from scipy.optimize import minimize

        best = self.at(begins[0], asked)

        def loss(values: FloatArray) -> float:
            nonlocal best
            found = self.at(Dynamics(*values), asked)
            if found.evidence > best.evidence:
                best = found
            return -found.evidence

        for begin in begins:
            cold = begin is self.known.start
            first = np.array(begin)
            wide = (COLD if cold else WARM) * np.diag(self.known.wide)
            options = {
                "maxfev": EVALUATIONS if cold else EVALUATIONS // 2,
                "initial_simplex": np.vstack([first, first + wide]),
            }
            minimize(loss, first, method="Nelder-Mead", options=options)
        return best
