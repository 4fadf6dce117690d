"""The probability of friction fitted to figures of known loops, and how well it is calibrated."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.judgement.figures import Figures, definitions
from stiction_ros.identification.judgement.probability import SURE

PENALTIES = (0.3, 1.0, 3.0, 10.0)  # of the squared slopes of standardised features
NEWTON = 60  # steps, at most
BINS = 10  # of probability, in which it is held against what is true


@dataclasses.dataclass(frozen=True)
class Judged:
    """One known loop and its figures."""

    world: str
    seed: int
    friction: bool
    figures: Figures


@dataclasses.dataclass(frozen=True)
class Fitted:
    """Log odds linear in the features: c_0 and the slopes, in the order of the figures."""

    constant: float
    slopes: FloatArray

    def probabilities(self, rows: Sequence[Judged]) -> FloatArray:
        """Return the probability of friction of each loop, shape (R,)."""
        odds = self.constant + np.array([row.figures.features() for row in rows]) @ self.slopes
        return np.asarray(1.0 / (1.0 + np.exp(-np.clip(odds, -30.0, 30.0))))

    def to_mapping(self) -> dict[str, object]:
        """Return constant and slopes by the names of the figures."""
        slopes = (round(float(value), 5) for value in self.slopes)
        return {
            "constant": round(self.constant, 5),
            "figures": dict(zip(definitions(), slopes, strict=True)),
        }


def fitted(rows: Sequence[Judged], penalty: float, without: str | None = None) -> Fitted:
    """Return the most likely coefficients.

    Args:
        rows: known loops; each world weighs as much as the others.
        penalty: of the squared slopes of standardised features.
        without: name of a figure that is left out.
    """
    features = np.array([row.figures.features() for row in rows])
    truth = np.array([row.friction for row in rows], dtype=float)
    worlds = [row.world for row in rows]
    weights = np.array([len(rows) / len(set(worlds)) / worlds.count(one) for one in worlds])
    mean, spread = features.mean(axis=0), features.std(axis=0)
    used = spread > 1e-9
    if without is not None:
        used[list(definitions()).index(without)] = False
    scaled = (features[:, used] - mean[used]) / spread[used]
    design = np.column_stack([np.ones(len(rows)), scaled])
    prior = penalty * np.eye(design.shape[1])
    prior[0, 0] = 1e-6
    found = np.zeros(design.shape[1])
    for _ in range(NEWTON):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ found, -30.0, 30.0)))
        slope = design.T @ (weights * (truth - chance)) - prior @ found
        curved = (design * (weights * chance * (1.0 - chance))[:, None]).T @ design + prior
        step = np.linalg.solve(curved, slope)
        found += step
        if np.abs(step).max() < 1e-9:
            break
    slopes = np.zeros(len(mean))
    slopes[used] = found[1:] / spread[used]
    return Fitted(float(found[0] - slopes @ mean), slopes)


def loss(probabilities: FloatArray, rows: Sequence[Judged]) -> float:
    """Return the mean of −log likelihood, nats a loop."""
    truth = np.array([row.friction for row in rows])
    told = np.where(truth, probabilities, 1.0 - probabilities)
    return float(-np.log(np.maximum(told, 1e-12)).mean())


def best_penalty(rows: Sequence[Judged]) -> float:
    """Return the penalty under which each world is told best by the others."""
    worlds = sorted({row.world for row in rows})

    def told_by_others(penalty: float) -> float:
        total = 0.0
        for world in worlds:
            own = [row for row in rows if row.world == world]
            rest = [row for row in rows if row.world != world]
            total += loss(fitted(rest, penalty).probabilities(own), own)
        return total

    return min(PENALTIES, key=told_by_others)


@dataclasses.dataclass(frozen=True)
class Bin:
    """Loops whose probability lies in one tenth: how many, its mean, and the share with friction."""

    loops: int
    told: float
    true: float


def reliability(probabilities: FloatArray, rows: Sequence[Judged]) -> list[Bin]:
    """Return the reliability in :data:`BINS` bins of probability, empty ones left out."""
    truth = np.array([row.friction for row in rows], dtype=float)
    place = np.minimum((probabilities * BINS).astype(int), BINS - 1)
    return [
        Bin(int(inside.sum()), float(probabilities[inside].mean()), float(truth[inside].mean()))
        for k in range(BINS)
        if (inside := place == k).any()
    ]


def counts(probabilities: FloatArray, rows: Sequence[Judged]) -> dict[str, float]:
    """Return the shares that verdicts are held to."""
    truth = np.array([row.friction for row in rows])
    found, cleared = probabilities >= SURE, probabilities <= 1.0 - SURE
    return {
        "loops": len(rows),
        "friction found": float(found[truth].mean()),
        "friction called healthy": float(cleared[truth].mean()),
        "others called sticky": float(found[~truth].mean()),
        "others called healthy": float(cleared[~truth].mean()),
        "loss": loss(probabilities, rows),
    }
