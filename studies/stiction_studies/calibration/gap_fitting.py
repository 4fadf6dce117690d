"""The probability of what ``gap`` names, fitted to answers about loops with something hidden."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from stiction_ros.discrepancy.decision.probability import Coefficients, Standing
from stiction_ros.effects import FloatArray
from stiction_studies.blind.scores.world_scores import WorldScore

Claim = tuple[float, Sequence[bool]]  # as of a score


def fitted(scores: Sequence[WorldScore]) -> Coefficients:
    """Return the figures under which what is true of all claims is likeliest."""
    claims = [claim for row in scores for claim in row.claims]
    ahead = np.log1p([max(evidence, 0.0) for evidence, _ in claims])
    side = np.array([1.0 if any(there) else -1.0 for _, there in claims])

    def misses(x: FloatArray) -> float:
        return float(np.logaddexp(0.0, -side * (x[0] + x[1] * ahead)).sum())

    constant, slope = minimize(misses, [0.0, 1.0], bounds=[(None, None), (0.0, None)]).x.tolist()
    return Coefficients(round(constant, 3), round(slope, 3))


def held(scores: Sequence[WorldScore], folds: int) -> tuple[FloatArray, FloatArray]:
    """Return the probability of each member of each claim, and whether it is there.

    Each fold of the seeds is told by figures that are fitted to the others.
    """
    told, there = [np.zeros(0)], [np.zeros(0)]
    for fold in range(folds):
        by = fitted([row for row in scores if row.seed % folds != fold])
        own = [claim for row in scores if row.seed % folds == fold for claim in row.claims]
        for likely, true in _told(own, by):
            told.append(likely)
            there.append(true)
    return np.concatenate(told), np.concatenate(there)


def _told(claims: Sequence[Claim], by: Coefficients) -> list[tuple[FloatArray, FloatArray]]:
    found = []
    for ahead, there in claims:
        told = Standing(ahead, range(len(there))).probabilities(by)
        found.append((np.array(list(told.values())), np.array(there, float)))
    return found
