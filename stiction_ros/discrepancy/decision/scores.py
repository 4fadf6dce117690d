"""Step 4: every candidate scored against the current model, which stays as it is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.candidate.decoys import decoys
from stiction_ros.discrepancy.candidate.output import output_candidates
from stiction_ros.discrepancy.candidate.plugged import plugged_candidates
from stiction_ros.discrepancy.candidate.valve import valve_candidates
from stiction_ros.discrepancy.candidate.wave import disturbance_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.effects import ExtraDelay, FloatArray, TimeShift

DATA = "data"  # the place of what is wrong with a record
Progress = Callable[[float], None]


@dataclasses.dataclass(frozen=True)
class Scores:
    """All candidates at their best, the best one first.

    Attributes:
        base: the current model.
        candidates: what was tried, one entry per behaviour and law.
        fits: one per candidate, sorted by ``delta_bic``.
    """

    base: Baseline
    candidates: tuple[Candidate, ...]
    fits: tuple[CandidateFit, ...]

    def of(self, place: str, effect: str) -> CandidateFit | None:
        """Return the best fit of an effect, its twins' included; None when not tried."""
        for fit in self.fits:
            if (place, effect) in fit.candidate.keys:
                return fit
        return None


def all_candidates(base: Baseline, clock_known: bool = False) -> tuple[Candidate, ...]:
    """Return every candidate that these records call for.

    Args:
        base: the current model.
        clock_known: whether the record's clock is shown to be right, so that a longer delay
            is no shift of the record.
    """
    gap = np.column_stack([noise.residual for noise in base.noise])
    whitened = [noise.innovations for noise in base.noise]
    found = valve_candidates(base.run) + output_candidates(base.run)
    found += disturbance_candidates(base.run, gap, whitened)
    found += plugged_candidates(base.run, whitened)
    if not clock_known:
        found = [
            each.or_else(DATA, TimeShift.effect) if each.effect == ExtraDelay.effect else each
            for each in found
        ]
    return tuple(found + decoys(base.run))


def score_candidates(
    base: Baseline,
    candidates: tuple[Candidate, ...],
    progress: Progress | None = None,
    gap: FloatArray | None = None,
    beside: Baseline | None = None,
) -> Scores:
    """Return the best figures and the score of every candidate.

    Args:
        base: the current model.
        candidates: what is tried.
        progress: called with the share done.
        gap: shape (N, p), what is to be explained; None for the recorded one.
        beside: the current model with figures of its process left open, which a curve is judged
            against; None where nothing of it was changed.
    """
    gap = base.run.gap if gap is None else gap
    fits = []
    for k, candidate in enumerate(candidates):
        against = beside if beside is not None and candidate.curved else base
        fits.append(fit_candidate(against, gap, candidate))
        if progress is not None:
            progress((k + 1) / len(candidates))
    fits.sort(key=lambda fit: -fit.delta_bic)
    return Scores(base, candidates, tuple(fits))
