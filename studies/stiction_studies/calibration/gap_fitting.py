"""The probability of what ``gap`` names, fitted to answers about loops with something hidden."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from stiction_ros.discrepancy.decision.probability import Coefficients, Standing
from stiction_ros.effects import FloatArray
from stiction_studies.blind.scores.world_scores import WorldScore

Claim = tuple[float, Sequence[tuple[float, bool]]]  # as of a score


def fitted(scores: Sequence[WorldScore]) -> Coefficients:
    """Return the figures under which what is true of all claims is likeliest."""
    claims = [claim for row in scores for claim in row.claims]
    true = [claim for claim in claims if any(there for _, there in claim[1])]
    ahead = np.log1p([max(evidence, 0.0) for evidence, _ in claims])
    side = np.array([1.0 if claim in true else -1.0 for claim in claims])

    def misses(x: FloatArray) -> float:
        return float(np.logaddexp(0.0, -side * (x[0] + x[1] * ahead)).sum())

    def strayed(logarithm: float) -> float:
        by = Coefficients(0.0, 0.0, math.exp(logarithm))  # a set has 1/2
        return -sum(math.log(2.0 * float(told @ there)) for told, there in _told(true, by))

    constant, slope = minimize(misses, [0.0, 1.0], bounds=[(None, None), (0.0, None)]).x.tolist()
    temperature = math.exp(minimize_scalar(strayed, bounds=(-2.0, 10.0), method="bounded").x)
    return Coefficients(round(constant, 3), round(slope, 3), round(temperature, 2))


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
    for ahead, members in claims:
        evidences, there = zip(*members, strict=True)
        told = Standing(ahead, dict(enumerate(evidences))).probabilities(by)
        found.append((np.array(list(told.values())), np.array(there, float)))
    return found
