"""How sure the figures are."""

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.deferred import halton_sequence
from stiction_ros.discrepancy.candidate.base import Candidate, figures_of, spans_of
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.misfit import misfit, settled
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.likelihood.noise import given_noise, information, shared_factors
from stiction_ros.discrepancy.measures import (
    ALL_AROUND,
    CONFIDENCE,
    FINE_ROUNDS,
    PROBE,
    SCATTERED,
    SLIGHT,
    SMOOTH,
    STEPPED,
)
from stiction_ros.effects import FloatArray
from stiction_ros.signals.autoregression import TINY, coloured

FARTHEST = 1.5  # times the difference of two points, by which another one moves


@dataclasses.dataclass(frozen=True)
class Region:
    """Points that the likelihood does not reject."""

    points: FloatArray  # values, shape (K, axes)
    excess: FloatArray  # of −2 log likelihood over the least one, shape (K,)

    @classmethod
    def around(cls, base: Baseline, fit: CandidateFit) -> "Region":
        """Search the region around a fit, factors at their best, noise as the fit left it.

        Points are thrown into boxes that follow what is not rejected, and along the differences
        of what is not: the likelihood of stems that rest and slip has many narrow peaks in a
        valley across the axes. Where the likelihood jumps, at a moment of the record or at a slip,
        it falls as a random walk with drift and not as a parabola: the bound is another.
        """
        axes = fit.candidate.axes
        free = [d for d, a in enumerate(axes) if a.spacing > 0.0 and not a.linear]
        if not free:
            return cls(fit.point[None, :], np.zeros(1))
        bound = STEPPED if fit.candidate.stepped else SMOOTH
        centre = fit.candidate.coordinates(fit.point)
        width = np.array([SLIGHT * axes[d].spacing for d in free])
        halton, random = halton_sequence(len(free), seed=0), np.random.default_rng(0)
        ar = {i: noise.ar for i, noise in fit.noise.items()}
        points, scores = np.zeros((0, len(axes))), np.zeros(0)
        kept = points
        for _ in range(FINE_ROUNDS):
            thrown = np.tile(centre, (SCATTERED + 1, 1))
            thrown[1:, free] += width * (2.0 * halton.random(SCATTERED) - 1.0)
            if len(kept) > len(free):
                along = thrown[1 : SCATTERED // 2]
                begun, one, other = (kept[random.integers(0, len(kept), len(along))] for _ in "123")
                along[:] = begun + FARTHEST * random.random((len(along), 1)) * (one - other)
            tried, response = settled(base, base.run.gap, fit.candidate, thrown, ar)
            found = misfit(base, base.run.gap, response, ar)
            points, scores = np.vstack([points, tried]), np.concatenate([scores, found])
            kept = points[scores - scores.min() <= bound]
            reach = np.abs(kept[:, free] - centre[free]).max(axis=0, initial=0.0)
            width = np.clip(1.5 * reach, 0.3 * width, 3.0 * width)
        excess = scores - scores.min()
        inside = excess <= bound
        return cls(fit.candidate.values(points[inside]), excess[inside])

    def shown(self) -> "Region":
        """Return the points that are extreme in one figure, the best ones, and some between."""
        ends = np.concatenate([self.points.argmin(axis=0), self.points.argmax(axis=0)])
        between = np.linspace(0, len(self.points) - 1, ALL_AROUND).astype(int)
        some = np.unique(np.concatenate([ends, between]))
        return Region(self.points[some], self.excess[some])


Intervals = dict[str, tuple[float, float]]


def likelihood_intervals(
    base: Baseline, fit: CandidateFit, beside: Sequence[FloatArray] = ()
) -> Intervals:
    """Return 95 % of each parameter by the likelihood, noise held at its best.

    What leaves −2 log likelihood within 3.84 of the least one is inside, factors of least squares
    and searched figures together; the region of the searched ones is found by :class:`Region`.
    Figures in which the response is a straight line have the ends of their parabola, all others
    held.

    Args:
        base: of the model without the effect.
        fit: the effect.
        beside: per output what other effects may do otherwise, shape (N, q): their figures are
            as little known as its own; empty where there are none.
    """
    if len(beside):
        columns = tuple(np.hstack(pair) for pair in zip(base.columns, beside, strict=True))
        base = dataclasses.replace(base, columns=columns)
    found: list[tuple[FloatArray, FloatArray]] = [(fit.point, fit.factors)]
    region = Region.around(base, fit).shown()
    for point, excess in zip(region.points, region.excess.tolist(), strict=True):
        if not len(fit.factors) or excess > SMOOTH:
            found.append((point, fit.factors))
            continue
        factors = _factors_at(base, fit, point) if len(point) or len(beside) else fit.factors
        sides = math.sqrt(SMOOTH - excess) * _factor_sides(base, fit, point)
        found += [(point, factors + side) for side in sides]
    found += [(point, fit.factors) for point in _linear_ends(base, fit)]
    return spans_of(_figures(fit.candidate, found))


def otherwise(base: Baseline, fit: CandidateFit) -> list[FloatArray]:
    """Return per output what an effect would do by other figures, shape (N, q).

    The ends of its region are such figures; those of least squares are columns already.

    Args:
        base: of the model without the effect.
        fit: the effect.
    """
    columns = [np.zeros((len(base.run.runs), 0)) for _ in base.columns]
    region = Region.around(base, fit)
    if not fit.point.size or len(region.points) < 2:
        return columns
    ends = np.concatenate([region.points.argmin(axis=0), region.points.argmax(axis=0)])
    points = np.vstack([fit.point[None, :], region.points[np.unique(ends)]])
    response = fit.candidate.respond(base.run, points)
    for i in response.outputs:
        own = response.moves(i, fit.factors)
        columns[i] = own[:, 1:] - own[:, :1]
    return columns


def bootstrap_intervals(
    base: Baseline,
    fit: CandidateFit,
    resamples: int,
    random: np.random.Generator,
    progress: Callable[[float], None] | None = None,
    beside: Sequence[FloatArray] = (),
) -> Intervals:
    """Return 95 % of each parameter by resampled blocks of innovations.

    Every resample is the fitted response with noise rebuilt from blocks of innovations of
    scored rows in random order, fitted again near the estimate. The interval is at least that of
    the likelihood.
    """
    found = []
    gap = base.run.gap
    response = fit.candidate.respond(base.run, fit.point[None, :])
    for b in range(resamples):
        drawn = gap.copy()
        for i in response.outputs:
            noise = fit.noise[i]
            fitted = gap[:, i] - noise.residual
            sound = noise.innovations[base.blocks[i].scored]
            drawn[:, i] = fitted + _rebuilt(
                sound, len(drawn), noise.ar, base.run.runs.block, random
            )
        again = fit_candidate(base, drawn, fit.candidate, fit.point if len(fit.point) else None)
        found.append((again.point, again.factors))
        if progress is not None:
            progress((b + 1) / resamples)
    values = _figures(fit.candidate, found)
    sure = likelihood_intervals(base, fit, beside)
    ends: Intervals = {}
    tails = 0.5 * (1.0 + np.array([-CONFIDENCE, CONFIDENCE]))
    for key in values[0]:
        low, high = np.quantile([v[key] for v in values], tails)
        other = sure.get(key, (float(low), float(high)))
        ends[key] = (min(float(low), other[0]), max(float(high), other[1]))
    return ends


def _linear_ends(base: Baseline, fit: CandidateFit) -> list[FloatArray]:
    """Return the ends of every linear figure, all others held, from its parabola of squares."""
    ends: list[FloatArray] = []
    ar = {i: noise.ar for i, noise in fit.noise.items()}
    rows = sum(noise.rows for noise in fit.noise.values())
    for d, axis in enumerate(fit.candidate.axes):
        if not axis.linear:
            continue
        reach = PROBE * max(abs(axis.low), abs(axis.high))
        tried = np.tile(fit.point, (3, 1))
        tried[:, d] += np.array([-reach, 0.0, reach])
        scores = misfit(base, base.run.gap, fit.candidate.respond(base.run, tried), ar)
        low, middle, high = np.exp(np.clip((scores - scores[1]) / max(rows, 1), None, 500.0))
        bend = 0.5 * (low - 2.0 * middle + high)  # of the squares, as a share of the least
        width = reach * np.sqrt(np.expm1(SMOOTH / max(rows, 1)) / max(bend, TINY))
        for side in (-width, width):
            end = fit.point.copy()
            end[d] = np.clip(end[d] + side, axis.low, axis.high)
            ends.append(end)
    return ends


def _factor_sides(base: Baseline, fit: CandidateFit, point: FloatArray) -> FloatArray:
    """Return how far the factors are sure to one standard deviation, all around, shape (K, s).

    Of two, as of a sine and its cosine, the whole ellipse: its size lies across both.
    """
    response = fit.candidate.respond(base.run, point[None, :])
    known = [
        information(sizes[:, 0], base.columns[i], fit.noise[i], base.blocks[i])
        for i, sizes in response.sizes.items()
    ]
    values, axes = np.linalg.eigh(np.linalg.pinv(np.sum(known, axis=0)))
    root = axes * np.sqrt(np.maximum(values, 0.0))
    if len(values) == 2:
        turns = 2.0 * np.pi * np.arange(ALL_AROUND) / ALL_AROUND
        return np.asarray(np.column_stack([np.cos(turns), np.sin(turns)]) @ root.T)
    spread = np.sqrt(np.maximum(np.sum(root**2, axis=1), 0.0))
    ends = (root @ root.T) / np.where(spread > 0.0, spread, 1.0)
    return np.vstack([ends, -ends])


def _factors_at(base: Baseline, fit: CandidateFit, point: FloatArray) -> FloatArray:
    response = fit.candidate.respond(base.run, point[None, :])
    own = {i: sizes[:, 0] for i, sizes in response.sizes.items()}
    again = {
        i: given_noise(
            base.run.gap[:, i],
            np.hstack([columns, base.columns[i]]),
            base.blocks[i],
            fit.noise[i].ar,
        )
        for i, columns in own.items()
    }
    return shared_factors(own, base.columns, again, base.blocks)


def _figures(
    candidate: Candidate, found: Sequence[tuple[FloatArray, FloatArray]]
) -> list[dict[str, float]]:
    """Return the parameters of searched figures and factors."""
    behaviours = [candidate.behaviour(*each) for each in found]
    return [figures_of(each) for each in behaviours if each is not None]


def _rebuilt(
    innovations: FloatArray, count: int, ar: FloatArray, block: int, random: np.random.Generator
) -> FloatArray:
    """Return ``count`` samples of noise from innovations in random order, a ``block`` at a time."""
    begins = random.integers(0, max(len(innovations) - block, 1), count // block + 1)
    drawn = np.resize(np.concatenate([innovations[b : b + block] for b in begins]), count)
    return coloured(drawn - drawn.mean(), ar)
