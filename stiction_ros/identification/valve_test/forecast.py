"""What further moves of OP would make of PV, by all that a test leaves possible."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.valve_test.judgement import Judgement
from stiction_ros.identification.valve_test.likelihood import CURVATURE, KNOWN, OWN_ERROR, Shape
from stiction_ros.identification.valve_test.search import UNSHOWN, Explanation, Trial
from stiction_ros.identification.valve_test.steps import Steps


@dataclasses.dataclass(frozen=True)
class Forecast:
    """PV a dead time after the ends of further holds, where it has gone farthest."""

    pv: FloatArray  # of an ideal valve and under each friction, shape (1 + G, J)
    alike: FloatArray  # the same from now on, by one process for all, which tells stems apart
    weights: FloatArray  # how likely each is, shape (1 + G,)
    counts: FloatArray  # the same of each friction of interest, 0 of others, shape (G,)
    # standard deviation of what is left open of each: where PV is, how the load walks, how the gain
    # changes with the opening, shape (J,)
    spread: FloatArray
    noise: FloatArray  # the same of the mean of PV over each hold, shape (J,)
    known: float  # precision of the gain, over its square, by the test so far

    @classmethod
    def of(cls, judgement: Judgement, levels: Sequence[float]) -> "Forecast":
        """Return it.

        Args:
            judgement: of the test so far.
            levels: OP after each further move, %, shape (J,).
        """
        trial, ideal, sticky = judgement.trial, judgement.ideal, judgement.sticky
        hold, count, ahead = round(trial.hold), len(trial.pv), len(levels)
        shape = Shape.of(sticky.dynamics, trial.hold)
        rows = np.append(trial.steps.rows, count + hold * np.arange(ahead))
        path = np.append(trial.steps.levels, levels)
        ends = hold * np.arange(1, ahead + 1)
        cells = judgement.frictions.along(Steps(rows, path, count + int(ends[-1])))
        to_come = _to_come(sticky, trial, rows, ends)
        pv = np.vstack([np.diff(path), cells.moves[cells.which]]) @ to_come
        pv[1:] *= sticky.gains[judgement.frictions.which][:, None]
        alike = pv.copy()
        alike[0] *= ideal.shown(trial.hold)[0] / max(float(shape.shown(trial.hold)), UNSHOWN)
        pv[0] = ideal.gains[0] * (np.diff(path) @ _to_come(ideal, trial, rows, ends))
        recent = trial.pv[trial.seen][-max(hold // 4, 1) :]
        lead = path[1:] - path[0]
        own = judgement.gain**2 * (OWN_ERROR**2 + (CURVATURE * lead**2) ** 2)
        noise = np.sqrt(sticky.noise**2 * shape.unsure(trial.hold) + own)
        walked = shape.load * (ends + shape.dead) + 1.0 / len(recent)
        return cls(
            recent.mean() + pv,
            alike,
            np.append(1.0 - judgement.weights.sum(), judgement.weights),
            judgement.weights * judgement.counts,
            np.sqrt(sticky.noise**2 * walked + own[-ahead:]),
            noise[-ahead:],
            KNOWN**-2 + float(((judgement.gain * lead / noise)[:-ahead] ** 2).sum()),
        )

    def beyond(self, low: float, high: float) -> float:
        """Return how likely PV is beyond a limit at one of the ends, at least."""
        above = ndtr((self.pv - high) / self.spread) + ndtr((low - self.pv) / self.spread)
        return float(self.weights @ above.max(axis=1))

    def apart(self, sizing: bool) -> float:
        """Return how well PV would tell the frictions, 0 to 1, from an ideal valve or each other.

        One less the Bhattacharyya coefficient of two Gaussians of the same width, on average.
        """
        middle, frictions = self.alike[0], self.alike[1:]
        if sizing:
            middle = self.counts @ frictions / self.counts.sum()
        apart, straight = (frictions - middle) / self.noise, self.alike[0] / self.noise
        energy = (apart**2).sum(axis=1)
        energy -= (apart @ straight) ** 2 / (self.known + straight @ straight)  # another gain
        return float(self.counts @ -np.expm1(-energy / 8.0))


def _to_come(explanation: Explanation, trial: Trial, rows: IntArray, ends: IntArray) -> FloatArray:
    """Return what PV is to show of steps from now until a dead time after each end, (M, J)."""
    shape = Shape.of(explanation.dynamics, trial.hold)
    since = len(trial.pv) - rows[:, None]
    return shape.shown(since + ends + shape.dead) - shape.shown(since)
