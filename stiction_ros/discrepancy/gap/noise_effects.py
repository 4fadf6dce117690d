"""Noise beyond the declared one, told as an effect: what wanders, how far, and where it enters."""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.discrepancy.candidate.base import figures_of, spans_of
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.noise_laws import (
    FLOOR,
    Block,
    Law,
    declared_block,
    laws_of,
    white_block,
)
from stiction_ros.discrepancy.likelihood.declared_noise import DeclaredNoise
from stiction_ros.discrepancy.likelihood.noise import SURPRISE
from stiction_ros.discrepancy.likelihood.state_noise import innovations, left_by_columns
from stiction_ros.discrepancy.measures import MARGIN, NORMAL
from stiction_ros.effects import Behaviour, ColouredDisturbance, FloatArray, RandomWalkDisturbance
from stiction_ros.signals.autoregression import TINY

CLOSE, SAME, TURNS = 1e-2, 0.05, 60  # of the search: figures, their likelihood, turns
REJECTED = 8.0  # −2 log likelihood, above that of the best figures
SHORTEST_WAY = 1e-3
FLAT = 1e-3  # curvature of the likelihood over a logarithm, below which it has none
CLEAR = 0.3  # by which the logarithm of a figure has to be inside of its range
NO_LAW = 30.0  # BIC by which a law may miss an autoregression and still be its name


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
    found = _at_their_best(base, output, declared)
    without = _Judge(base, output, declared).score(white_block(0.0))
    enough = without.fitted + without.held - least * int(base.blocks[output].train.sum())
    better = [each for each in found if each.score < enough]
    lasts = float(base.run.runs.time.max())
    near = sorted(_without_walks(better, lasts), key=lambda each: each.score)
    return [each for each in near if each.score <= near[0].score + NO_LAW]


def _at_their_best(base: Baseline, output: int, declared: DeclaredNoise) -> list[NoiseEffect]:
    """Return the laws that have figures, kept."""
    name = ("noise effects", output, declared.std, declared.ar.tobytes())
    if name not in base.known:
        judge = _Judge(base, output, declared)
        fitted = [judge.fitted(law) for law in laws_of(base, output, declared)]
        base.known[name] = [each for each in fitted if each is not None]
    found: list[NoiseEffect] = base.known[name]
    return found


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
        runs = base.run.runs
        self.own, self.blocks = declared_block(base, output, declared), base.blocks[output]
        values = np.column_stack([base.run.gap[:, output], base.columns[output]])
        self.values, self.seen = np.ascontiguousarray(values.T), runs.usable[output]
        self.begins = np.zeros(len(runs), dtype=bool)
        self.begins[[rows.start for rows in runs.slices]] = True

    def score(self, block: Block) -> _Score:
        """Return how likely the states of a law are beside those of the declared noise."""
        own, blocks = self.own, self.blocks
        unit = max(own.r, float(np.trace(own.q)), TINY)
        white, variances = innovations(
            block_diag(own.a, block.a),
            block_diag(own.q, block.q) / unit,
            np.concatenate([own.c, block.c]),
            max(own.r, FLOOR * unit) / unit,
            block_diag(own.start, block.start) / unit,
            self.values,
            self.seen,
            self.begins,
        )
        if not np.isfinite(white).all():
            return _Score(math.inf, 0.0, 1.0)
        left, logs = left_by_columns(white, self.values, blocks.train), np.log(variances)
        inside, outside = left[blocks.train], left[blocks.held]
        variance = max(float(inside @ inside) / len(inside), TINY)
        log = math.log(2.0 * math.pi * variance)
        outside = np.minimum(outside**2 / variance, SURPRISE**2)
        fitted = len(inside) * (log + 1.0) + float(logs[blocks.train].sum())
        held = len(outside) * log + float(logs[blocks.held].sum()) + float(outside.sum())
        return _Score(fitted, held, math.sqrt(variance / unit))

    def loss(self, law: Law, x: FloatArray) -> float:
        """Return −2 log likelihood of the fitted rows; inf beyond the range of the figures."""
        low, high = law.range
        if np.any(x < low) or np.any(x > high):
            return math.inf
        return self.score(law.block(x)).fitted

    def fitted(self, law: Law) -> NoiseEffect | None:
        """Return a law with its figures; None where one of them holds nothing out."""
        from scipy.optimize import minimize

        loss = functools.partial(self.loss, law)
        options = {"xatol": CLOSE, "fatol": SAME, "maxiter": TURNS}
        tried = [minimize(loss, x, method="Nelder-Mead", options=options) for x in law.starts]
        best = min(tried, key=lambda each: float(each.fun))
        found, (low, high) = np.asarray(best.x), law.range
        bound = np.any(found < low + CLEAR) or np.any(found > high - CLEAR)
        if not math.isfinite(best.fun) or bound:
            return None  # a figure on the bound of its range is no name
        score = self.score(law.block(found))
        rows = max(int(self.blocks.train.sum()), 2)
        price = len(found) * math.log(rows) + MARGIN
        first = np.eye(len(found))[0]  # is a size: σ is its unit
        behaviour = law.behaviour(found + math.log(score.louder) * first)
        ends = _ends(loss, found, law.range)
        if not all(np.isfinite(end).all() for _, end in ends):
            return None  # an interval that holds nothing out is no name
        figures = [figures_of(behaviour)]
        for side, end in ends:
            scale = math.log(self.score(law.block(end)).louder)
            scale += side * NORMAL / math.sqrt(2.0 * rows)
            figures.append(figures_of(law.behaviour(end + scale * first)))
        whole = score.fitted + score.held + price
        return NoiseEffect(law.place, behaviour, spans_of(figures), whole)


def _ends(
    loss: Callable[[FloatArray], float], found: FloatArray, limits: tuple[FloatArray, FloatArray]
) -> list[tuple[float, FloatArray]]:
    """Return the side and the point of both ends of each figure's 95 %, by the curvature."""
    count, step = len(found), 0.1
    shifts = step * np.eye(count)
    centre = loss(found)
    bend = np.zeros((count, count))
    for i in range(count):
        for j in range(i, count):
            corner = loss(found + shifts[i] + shifts[j]) + loss(found - shifts[i] - shifts[j])
            other = loss(found + shifts[i] - shifts[j]) + loss(found - shifts[i] + shifts[j])
            bend[i, j] = bend[j, i] = (corner - other) / (4.0 * step**2)
        plus, minus = loss(found + shifts[i]), loss(found - shifts[i])
        bend[i, i] = (plus + minus - 2.0 * centre) / step**2
    if not np.isfinite(bend).all():
        return [(-1.0, limits[0]), (1.0, limits[1])]
    sizes, axes = np.linalg.eigh(0.5 * bend)
    spread = (axes / np.maximum(sizes, FLAT)) @ axes.T  # what does not bend is not known at all
    ways = NORMAL * spread / np.sqrt(np.diag(spread))  # each figure's end, the others at their best
    ends = []
    for way in ways.T:
        for side in (-1.0, 1.0):
            share = side  # a valley may be bent: back to what the likelihood does not reject
            while abs(share) > SHORTEST_WAY:
                end = np.clip(found + share * way, *limits)
                if loss(end) < centre + REJECTED:
                    break
                share *= 0.5
            ends.append((side, end))
    return ends
