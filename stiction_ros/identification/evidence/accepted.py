"""Which frictions a record does not reject."""

import dataclasses

import numpy as np

from stiction_ros.deferred import chi2_quantile
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.candidate import Judge
from stiction_ros.identification.evidence.fit_problem import LIMIT, NOISE_ORDER, Problem
from stiction_ros.identification.evidence.search import Found
from stiction_ros.identification.friction import coarse_grid, finer_grid
from stiction_ros.signals.autoregression import innovations, noise_of

Interval = tuple[float, float]

FREEDOM = 3  # f_S, f_D, and one for the choice among many
MISFIT = 0.1
"""Share of the evidence for friction itself on which no friction is rejected: no valve obeys a
law to the letter, and what the law misses weighs as much as what it explains grows."""
HARMLESS = 0.08  # of the range of OP: a valve is healthy when all larger bands are rejected
STEPS = (0.3, 0.1, 0.03, 0.01, 0.003)  # of f_S + f_D: grids round the best
OUTWARDS = 0.01 * np.arange(1.0, 13.0)
"""Shares of f_S + f_D past the ends of what is accepted: as far as to the next node of a grid."""
BETWEEN = 2.0  # standard deviations of OP's innovations by which an end may lie farther out
LATE = 1.0  # samples by which a stem answers late, at most


@dataclasses.dataclass(frozen=True)
class Accepted:
    """Frictions of one valve, shares of the span of OP."""

    # static, dynamic, band: hulls of f_S, f_D and f_S + f_D of what is not rejected
    static: Interval
    dynamic: Interval
    band: Interval
    # −2 log of the marginal likelihood that the friction of this valve adds to a model in which it
    # has none
    gain: float
    deadband_loss: float  # by how much the best f_D = f_S is worse than the best
    # what the best friction adds whose band is above ``HARMLESS``; below 0 where all such are less
    # likely than none
    material_gain: float

    def times(self, span: float) -> "Accepted":
        """Return the same with frictions in % of a valve whose OP has this span, %."""
        static, dynamic, band = (
            (span * low, span * high) for low, high in (self.static, self.dynamic, self.band)
        )
        return dataclasses.replace(self, static=static, dynamic=dynamic, band=band)


def accepted(problem: Problem, found: Found, valve: int, confidence: float) -> Accepted:
    """Hold frictions near the best, and all that the search met, against the best."""
    gain = found.without[valve].loss - found.best.loss
    slack = chi2_quantile(confidence, FREEDOM) + MISFIT * max(gain, 0.0)
    judge = Judge.of(problem, found.best, valve, found.best.fits, held=True)
    tried, lost = _looked_at(judge, found)
    beyond = _beyond(tried[lost <= lost.min() + slack])
    rows = np.vstack([tried, beyond])[:, :2]
    lost = np.concatenate([lost, judge.losses(beyond)])
    material = float(lost[rows.sum(axis=1) > HARMLESS].min(initial=np.inf))
    lost = lost - lost.min()
    inside = lost <= slack
    static, dynamic = rows[inside].T
    band = static + dynamic
    flat = rows[:, 1] >= rows[:, 0] * (1.0 - 1e-9)
    return Accepted(
        static=(float(static.min()), float(static.max())),
        dynamic=(float(dynamic.min()), float(dynamic.max())),
        band=(float(band.min()), float(band.max())),
        gain=gain,
        deadband_loss=float(lost[flat].min(initial=np.inf)),
        material_gain=found.without[valve].loss - material,
    )


def _looked_at(judge: Judge, found: Found) -> tuple[FloatArray, FloatArray]:
    """Return rows (f_S, f_D, start), shape (G, 3), and their losses, those of exact fits first."""
    best, valve = found.best, judge.valve
    met = [one for one in found.met if one.friction[valve, 0] > 0.0] or [best]
    exact = np.array([[*one.friction[valve], one.starts[valve]] for one in met])
    centre = best.friction[valve]
    grids = [coarse_grid(LIMIT)]
    if centre[0] > 0.0:
        size = float(centre.sum())
        grids += [finer_grid(centre[None, :], step * size / 3.0, LIMIT) for step in STEPS]
    grid = np.vstack(grids)
    deadbands = np.repeat(np.unique(grid[:, :1]), 2).reshape(-1, 2)
    grid = np.vstack([grid, deadbands])
    rows = np.column_stack([grid, np.full(len(grid), best.starts[valve])])
    lost = [np.array([one.loss for one in met]), judge.losses(rows)]
    return np.vstack([exact, rows]), np.concatenate(lost)


def _beyond(inside: FloatArray) -> FloatArray:
    """Return rows (f_S, f_D, start) past both ends of the band of those that are accepted.

    A grid ends the interval at its last accepted node; where the loss reaches the limit lies
    between this and the next.
    """
    band = inside[:, :2].sum(axis=1)
    out = []
    for end, way in ((inside[band.argmin()], -1.0), (inside[band.argmax()], 1.0)):
        moved = way * OUTWARDS[:, None]
        alike = end[:2] * (1.0 + moved)
        same_jump = np.maximum(end[:2] + 0.5 * moved * end[:2].sum(), 0.0)
        grid = np.vstack([alike, same_jump])
        out.append(np.column_stack([grid, np.full(len(grid), end[2])]))
    return np.vstack(out)


@dataclasses.dataclass(frozen=True)
class Unseen:
    """By how much one end may lie elsewhere than the samples show; unit of OP, 0 or more.

    The stem feels what OP does between samples, too, and slips at peaks there. And it may answer up
    to a sample later than OP moves: what OP has moved on by then is no friction. The band f_S + f_D
    is what OP passes from one slip to the next in the other direction, the jump f_S − f_D to the
    next in the same direction. A jump is not smaller for answering late: of a slip that samples
    give no reason for, a smaller jump makes the best already.
    """

    less: float  # what OP moves before the stem answers
    more: float  # by how much OP goes farther between samples

    @classmethod
    def of(cls, op: FloatArray) -> "Unseen":
        """Return what samples of OP leave open, shape (N,), N at least 20."""
        return cls(LATE * float(np.abs(np.diff(op)).mean()), BETWEEN * innovation(op))

    def band(self, held: Interval) -> Interval:
        """Return the f_S + f_D that are possible where the samples accept ``held``."""
        return max(held[0] - 2.0 * self.less, 0.0), held[1] + 2.0 * self.more

    def static(self, held: Interval) -> Interval:
        """Return the f_S, half of band and jump, that are possible."""
        return max(held[0] - self.less, 0.0), held[1] + 2.0 * self.more

    def dynamic(self, held: Interval) -> Interval:
        """Return the f_D, half of what the band has more than the jump, that are possible."""
        return max(held[0] - self.less - self.more, 0.0), held[1] + self.more


def innovation(op: FloatArray) -> float:
    """Return the standard deviation of what the past of OP does not tell."""
    op = op - op.mean()
    return float(innovations(noise_of(op, NOISE_ORDER), op)[NOISE_ORDER:].std())
