"""The points of a search that the likelihood does not reject."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.deferred import halton_sequence
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.misfit import misfit, settled
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.effects import FloatArray

SMOOTH = 3.84  # 95 % of one degree of freedom
STEPPED = 7.35  # 95 % of the place of a step, (1 - exp(-x / 2))²: Hansen, Econometrica 68 (2000)
FIRST_BOX = 0.05  # of a step of the first grid
BOXES = 10
SCATTERED = 300
FARTHEST = 1.5  # times the difference of two points, by which another one moves
SHOWN = 20


@dataclasses.dataclass(frozen=True)
class Region:
    """Points that the likelihood does not reject.

    Attributes:
        points: values, shape (K, axes).
        excess: of −2 log likelihood over the least one, shape (K,).
    """

    points: FloatArray
    excess: FloatArray

    @classmethod
    def around(cls, base: Baseline, fit: CandidateFit) -> Region:
        """Search the region around a fit, factors at their best, noise as the fit left it.

        Points are thrown into boxes that follow what is not rejected, and along the differences
        of what is not: the likelihood of stems that rest and slip has many narrow peaks in a
        valley across the axes. Where it jumps, at a moment of the record or at a slip, what the
        rejected points differ by is no parabola but a walk that drifts, and its bound another.
        """
        axes = fit.candidate.axes
        free = [d for d, a in enumerate(axes) if a.spacing > 0.0 and not a.linear]
        if not free:
            return cls(fit.point[None, :], np.zeros(1))
        bound = STEPPED if fit.candidate.stepped else SMOOTH
        centre = fit.candidate.coordinates(fit.point)
        least = np.array([1.0 if axes[d].whole else 0.0 for d in free])
        width = np.maximum([FIRST_BOX * axes[d].spacing for d in free], least)
        halton, random = halton_sequence(len(free), seed=0), np.random.default_rng(0)
        points, scores = np.zeros((0, len(axes))), np.zeros(0)
        kept = points
        for _ in range(BOXES):
            thrown = np.tile(centre, (SCATTERED + 1, 1))
            thrown[1:, free] += width * (2.0 * halton.random(SCATTERED) - 1.0)
            if len(kept) > len(free):
                along = thrown[1 : SCATTERED // 2]
                begun, one, other = (kept[random.integers(0, len(kept), len(along))] for _ in "123")
                along[:] = begun + FARTHEST * random.random((len(along), 1)) * (one - other)
            tried, found = scored(base, fit, thrown)
            points, scores = np.vstack([points, tried]), np.concatenate([scores, found])
            kept = points[scores - scores.min() <= bound]
            reach = np.abs(kept[:, free] - centre[free]).max(axis=0, initial=0.0)
            width = np.maximum(np.clip(1.5 * reach, 0.3 * width, 3.0 * width), least)
        excess = scores - scores.min()
        inside = excess <= bound
        return cls(fit.candidate.values(points[inside]), excess[inside])

    def shown(self) -> Region:
        """Return the points that are extreme in one figure, the best ones, and some between."""
        ends = np.concatenate([self.points.argmin(axis=0), self.points.argmax(axis=0)])
        between = np.linspace(0, len(self.points) - 1, SHOWN).astype(int)
        some = np.unique(np.concatenate([ends, between]))
        return Region(self.points[some], self.excess[some])


def scored(
    base: Baseline, fit: CandidateFit, coordinates: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return coordinates, linear figures at their best, and the misfit there."""
    ar = {i: noise.ar for i, noise in fit.noise.items()}
    points = settled(base, base.run.gap, fit.candidate, coordinates, ar)
    response = fit.candidate.respond(base.run, fit.candidate.values(points))
    return points, misfit(base, base.run.gap, response, ar)
