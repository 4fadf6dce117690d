"""Intervals of a valve's figures, the process left free to go with them."""

from __future__ import annotations

import numpy as np

from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.region import SMOOTH
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.fit.uncertainty import Intervals
from stiction_ros.discrepancy.process.free_search import FreeSearch
from stiction_ros.effects import FloatArray

BOX = 9
SCALES = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)  # half widths of the boxes, steps of the first grid


def with_free_process(
    intervals: Intervals, base: Baseline, fit: CandidateFit, longest: int
) -> Intervals:
    """Return the intervals, widened by what another process would allow.

    On boxes of several widths around the fit the process is eliminated at every point, under
    the noise of the fit; points within 3.84 of the least −2 log likelihood belong to the
    interval. Effects elsewhere than in a valve keep their intervals.

    Args:
        intervals: with the process as it is, by parameter.
        base: of the model without the effect, with the process that was fitted behind it.
        fit: the effect.
        longest: delay tried, samples.
    """
    if not isinstance(fit.candidate, ValveCandidate) or not fit.candidate.axes:
        return intervals
    ends = dict(intervals)
    for point in _region(base, fit, fit.candidate, longest):
        behaviour = fit.candidate.behaviour(base.run, point, fit.factors)
        for key, value in figures_of(behaviour).items():
            if key in ends:
                low, high = ends[key]
                ends[key] = (min(low, value), max(high, value))
    return ends


def _region(
    base: Baseline, fit: CandidateFit, candidate: ValveCandidate, longest: int
) -> FloatArray:
    """Return points that the likelihood does not reject, shape (K, axes), values."""
    axes = candidate.axes
    centre = candidate.coordinates(fit.point)
    steps = np.array([axis.spacing if axis.points > 1 else 0.0 for axis in axes])
    free = np.flatnonzero(steps)
    sides = np.meshgrid(*[np.linspace(-1.0, 1.0, BOX)] * len(free), indexing="ij")
    mesh = np.zeros((sides[0].size, len(axes)))
    mesh[:, free] = np.stack([side.ravel() for side in sides], axis=1)
    boxes = [centre + scale * steps * mesh for scale in SCALES]
    grid = np.vstack([centre[None, :], *boxes])
    loss = FreeSearch(base, candidate, longest).loss_near(grid, fit.noise)
    return candidate.values(grid[loss <= loss.min() + SMOOTH])
