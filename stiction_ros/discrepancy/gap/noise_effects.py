"""Noise beyond the declared one, told as an effect: what wanders, how far, and where it enters."""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.candidate.base import figures_of, spans_of
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.noise_laws import Block, Law, declared_block, laws_of
from stiction_ros.discrepancy.likelihood.declared_noise import DeclaredNoise, steady_gain
from stiction_ros.discrepancy.likelihood.least_squares import left_by_columns
from stiction_ros.discrepancy.measures import (
    LARGER,
    MARGIN,
    NORMAL,
    ROUNDS,
    SMOOTH,
    SURE,
    SURPRISE,
    TRACE,
)
from stiction_ros.effects import Behaviour, ColouredDisturbance, FloatArray, RandomWalkDisturbance
from stiction_ros.signals.autoregression import TINY

POINTS = 13  # of a lattice along each figure
CLEAR = math.log(LARGER)  # by which the logarithm of a figure has to be inside of its range
NO_LAW = MARGIN + SURE  # BIC by which a law may miss an autoregression and still be its name


@dataclasses.dataclass(frozen=True)
class NoiseEffect:
    """One law of a larger noise at its best."""

    place: str  # place, behaviour: as loop models name them
    behaviour: Behaviour
    intervals: dict[str, tuple[float, float]]  # 95 % of each figure
    # −2 log likelihood of fitted and held-out rows, and the price of its figures as of an effect
    score: float


def noise_effects(
    base: Baseline, output: int, declared: DeclaredNoise, least: float = 0.0
) -> list[NoiseEffect]:
    """Return the laws by which an output's noise may be larger than declared, the best first.

    Each law stands beside the declared noise in one state-space model, whose innovations are
    judged on the same rows as every other explanation.

    Args:
        base: the model with its effects.
        output: its index.
        declared: its noise.
        least: what a law has to gain a row in −2 log likelihood.

    Returns:
        The laws that beat the declared noise, with its rounding; the best first, and those that are
        near it.
    """
    judge, own = _Judge(base, output, declared), base.under_declared(output)
    fitted = [judge.fitted(law) for law in laws_of(base, output, declared)]
    enough = own.bic(0) + own.held_minus_two_log - least * own.rows
    better = [each for each in fitted if each is not None and each.score < enough]
    lasts = float(base.run.runs.time.max())
    near = sorted(_without_walks(better, lasts), key=lambda each: each.score)
    return [each for each in near if each.score <= near[0].score + NO_LAW]


def _without_walks(laws: list[NoiseEffect], lasts: float) -> list[NoiseEffect]:
    """Return laws without a coloured noise that may last as long as the record.

    Within the record that is a random walk, which has one figure less.
    """
    walks = [each.score for each in laws if isinstance(each.behaviour, RandomWalkDisturbance)]
    return [
        each
        for each in laws
        if not isinstance(each.behaviour, ColouredDisturbance)
        or each.intervals["tau"][1] < lasts * math.exp(-CLEAR)
        or each.score < min(walks, default=math.inf) - MARGIN
    ]


class _Score(NamedTuple):
    """How likely a law is with given figures."""

    fitted: float  # fitted, held: −2 log likelihood of fitted and of held-out rows
    held: float
    louder: float  # σ over that of the figures


class _Judge:
    """The likelihood of laws beside the declared noise of one output.

    The ratio of the law to the declared noise is what counts: σ is left open as everywhere.
    """

    def __init__(self, base: Baseline, output: int, declared: DeclaredNoise) -> None:
        self.own, self.blocks = declared_block(base, output, declared), base.blocks[output]
        self.records, seen = base.run.runs.slices, base.run.runs.usable[output]
        self.values = np.vstack([base.run.gap[:, output], base.columns[output].T])
        rows = np.arange(len(seen))
        for each in self.values:  # what is no measurement is drawn between its neighbours
            each[~seen] = np.interp(rows[~seen], rows[seen], each[seen])

    def scores(self, found: Sequence[Block]) -> list[_Score]:
        """Return how likely the states of laws are beside those of the declared noise."""
        own = self.own
        unit = max(own.r, float(np.trace(own.q)), TINY)
        a = np.stack([block_diag(own.a, each.a) for each in found])
        q = np.stack([block_diag(own.q, each.q) / unit for each in found])
        c = np.concatenate([own.c, found[0].c])
        steady = zip(a, *steady_gain(a, q, c, max(own.r / unit, TRACE)), strict=True)
        return [self._score(each, gain, c, missed * unit) for each, gain, missed in steady]

    def _score(self, a: FloatArray, gain: FloatArray, c: FloatArray, foretold: float) -> _Score:
        """Return how likely it is what a gain leaves, whose variance is foretold."""
        blocks = self.blocks
        over, under = (np.real(np.poly(each)) for each in (a, a - np.outer(gain, c)))
        parts = [lfilter(over, under, self.values[:, rows], axis=1) for rows in self.records]
        left = left_by_columns(np.hstack(parts), self.values, blocks.train)
        inside, outside = left[blocks.train], left[blocks.held]
        variance = max(float(inside @ inside) / len(inside), TINY)
        log = math.log(2.0 * math.pi * variance)
        outside = np.minimum(outside**2 / variance, SURPRISE**2)
        held = len(outside) * log + float(outside.sum())
        return _Score(len(inside) * (log + 1.0), held, math.sqrt(variance / foretold))

    def fitted(self, law: Law) -> NoiseEffect | None:
        """Return a law with its figures; None where one holds nothing."""
        points, scores = self.lattice(law)
        fitted = np.array([score.fitted for score in scores])
        best, (low, high) = int(np.argmin(fitted)), law.range
        found = points[best]
        if np.any(found < low + CLEAR) or np.any(found[1:] > high[1:] - CLEAR):
            return None  # on the bound of its range: then it is no name
        rows = max(int(self.blocks.train.sum()), 2)
        price = len(found) * math.log(rows) + MARGIN
        first = np.eye(len(found))[0]  # is a size: σ is its unit
        behaviour = law.behaviour(found + math.log(scores[best].louder) * first)
        figures = [figures_of(behaviour)]
        for k in np.flatnonzero(fitted - fitted[best] <= SMOOTH).tolist():
            for side in (-NORMAL, NORMAL):
                scale = math.log(scores[k].louder) + side / math.sqrt(2.0 * rows)
                figures.append(figures_of(law.behaviour(points[k] + scale * first)))
        whole = scores[best].fitted + scores[best].held + price
        return NoiseEffect(law.place, behaviour, spans_of(figures), whole)

    def lattice(self, law: Law) -> tuple[FloatArray, list[_Score]]:
        """Return the figures that the likelihood does not reject, and some about them.

        Each lattice covers the figures that the lattice before did not reject. A coarse lattice
        misses the bottom of a narrow valley, so coarse lattices reject less than fine ones.
        """
        low, high = law.range
        for turn in reversed(range(ROUNDS)):
            step = (high - low) / (POINTS - 1)
            meshed = np.meshgrid(*np.linspace(low, high, POINTS).T, indexing="ij")
            points = np.stack([each.ravel() for each in meshed], axis=1)
            scores = self.scores([law.block(point) for point in points])
            fitted = np.array([score.fitted for score in scores])
            bound = SMOOTH if turn <= 1 else SURE
            kept = points[fitted - fitted.min() <= bound]
            low = np.maximum(kept.min(axis=0) - step, law.range[0])
            high = np.minimum(kept.max(axis=0) + step, law.range[1])
        return points, scores
