"""The evidence of each hypothesis, averaged over process and noise for each by itself."""

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from stiction_ros.deferred import halton_sequence
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.identification.valve_test.frictions import LEVELS, Frictions
from stiction_ros.identification.valve_test.likelihood import Answered, Dynamics, Shape, log_sum
from stiction_ros.identification.valve_test.steps import Steps

EVALUATIONS = 150  # of a search over process and noise
DRAWS = 64  # of process and noise, over which the evidence is averaged
CURVED = 0.1  # share of the width of the prior by which the evidence is differenced
# first steps of a search over the width of the prior: from its middle, and from a former end
COLD, WARM = 0.7, 0.3
UNSHOWN = 1e-3  # least share of a step that PV is taken to show within a hold
START = Dynamics(lag=-0.5, second=-1.0, dead=-1.5, load=-5.0, kept=0.0, noise=-2.0)
# middle and standard deviation of the prior of process and noise, weak as they are known to a
# decade or so: a hold lasts for a dead time and one or two lags, a load moves less than noise
WIDE = Dynamics(lag=1.7, second=1.5, dead=1.0, load=2.0, kept=1.5, noise=2.0)


@dataclasses.dataclass(frozen=True)
class Explanation:
    """Friction, or none, over all processes and noises."""

    evidence: float  # log of how likely the record is
    dynamics: Dynamics  # the best process and noise
    values: FloatArray  # log of how likely it is with each set of moves of the stem, shape (U,)
    gains: FloatArray  # K of each, at the best process
    noise: float  # σ of the white noise, engineering units

    def shown(self, hold: float) -> FloatArray:
        """Return what 1 % of the stem makes of PV within a hold of some samples, shape (U,)."""
        return self.gains * Shape.of(self.dynamics, hold).shown(hold)

    def hidden(self, hold: float) -> FloatArray:
        """Return the move of the stem that makes as much of PV as its noise, %, shape (U,)."""
        noise = self.noise * math.sqrt(1.0 + Shape.of(self.dynamics, hold).noise[1])
        return noise / np.maximum(np.abs(self.shown(hold)), 1e-300)

    def cells(self, frictions: Frictions) -> FloatArray:
        """Return how likely each cell is, shape (G,)."""
        return np.asarray(np.exp(self.values[frictions.which] + frictions.logs - self.evidence))


@dataclasses.dataclass(frozen=True)
class Trial:
    """A record of steps that is searched."""

    pv: FloatArray  # shape (N,)
    seen: BoolArray  # samples that were measured, shape (N,)
    steps: Steps  # of OP
    # what 1 % of the stem makes of PV within a hold as it was known before; None: nothing
    gain: float | None = None

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
        gain = self.gain
        if gain is not None:
            gain /= max(float(shape.shown(self.hold)), UNSHOWN)
        answered = Answered.of(self.pv, self.seen, self.steps, shape)
        told = zip(dynamics, START, WIDE, strict=True)
        prior = -0.5 * sum(((value - middle) / wide) ** 2 for value, middle, wide in told)
        moves = asked.moves if isinstance(asked, Frictions) else asked
        values, gains, noise = answered.likelihoods(moves, gain)
        values += prior
        return Explanation(_evidence(values, asked), dynamics, values, gains, noise)

    def explained(self) -> tuple[Explanation, Explanation, Explanation, Frictions]:
        """Return how an ideal valve, a PV that OP does not move, and friction explain the record.

        Each search also begins where another ended, as each may miss the best process.
        """
        moves, still = np.diff(self.steps.levels)[None], np.zeros((1, len(self.steps.rows)))
        frictions = Frictions.all(self.steps)
        ideal = self._best((START,), moves)
        sticky = self._best((START, ideal.dynamics), frictions)
        for _ in range(LEVELS):
            frictions = frictions.refined(self.steps, sticky.cells(frictions))
            sticky = self.at(sticky.dynamics, frictions)
        sticky = self._best((sticky.dynamics,), frictions)
        frictions = frictions.refined(self.steps, sticky.cells(frictions))
        sticky = self.at(sticky.dynamics, frictions)
        ideal = max(ideal, self._best((sticky.dynamics,), moves), key=lambda one: one.evidence)
        none = self._averaged(self._best((START,), still), still)
        return self._averaged(ideal, moves), none, self._averaged(sticky, frictions), frictions

    def _averaged(self, best: Explanation, asked: Frictions | FloatArray) -> Explanation:
        """Return an explanation with its evidence averaged over process and noise.

        By importance sampling about the best, as wide in each direction as the evidence is there.
        """
        middle, most = np.array(best.dynamics), best.evidence
        wide = np.array(WIDE)
        spread = wide.copy()
        for i, step in enumerate(np.diag(CURVED * wide)):
            sides = (self.at(Dynamics(*(middle + way * step)), asked) for way in (-1.0, 1.0))
            fall = most - 0.5 * sum(side.evidence for side in sides)
            spread[i] = min(wide[i], CURVED * wide[i] / math.sqrt(max(2.0 * fall, 1e-3)))
        points = ndtri(halton_sequence(len(middle), seed=0).random(DRAWS))
        weights = 0.5 * (points**2).sum(axis=1) + float(np.log(spread / wide).sum())
        values = np.full(len(best.values), -np.inf)
        for point, weight in zip(points, weights - math.log(DRAWS), strict=True):
            one = self.at(Dynamics(*(middle + spread * point)), asked)
            values = np.logaddexp(values, one.values + weight)
        return dataclasses.replace(best, evidence=_evidence(values, asked), values=values)

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
            cold = begin is START
            first = np.array(begin)
            wide = (COLD if cold else WARM) * np.diag(WIDE)
            options = {
                "maxfev": EVALUATIONS if cold else EVALUATIONS // 2,
                "initial_simplex": np.vstack([first, first + wide]),
            }
            minimize(loss, first, method="Nelder-Mead", options=options)
        return best


def _evidence(values: FloatArray, asked: Frictions | FloatArray) -> float:
    return log_sum(values + asked.prior if isinstance(asked, Frictions) else values)
