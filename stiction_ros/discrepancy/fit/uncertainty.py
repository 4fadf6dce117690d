"""How sure the figures are, and how large a score chance alone brings about."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stiction_ros.deferred import halton_sequence
from stiction_ros.discrepancy.candidate.base import Candidate, figures_of
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.misfit import misfit
from stiction_ros.discrepancy.fit.misfit_kernels import whitened_shifts
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.fit.settled import PROBE, settled
from stiction_ros.discrepancy.fit.shared_factors import information, shared_factors
from stiction_ros.discrepancy.likelihood.noise import (
    coloured,
    given_noise,
    left_by,
    projector,
    whiten,
    whitened_columns,
)
from stiction_ros.effects import FloatArray

CHI_SQUARE = 3.84  # 95 % of one degree of freedom
NORMAL = 1.96
TINY = 1e-300
FIRST_BOX = 0.05  # of a step of the first grid
BOXES = 10
SCATTERED = 300
SHOWN = 20
BLOCK = 25
DRAWS = 200

Intervals = dict[str, tuple[float, float]]


def likelihood_intervals(base: Baseline, fit: CandidateFit) -> Intervals:
    """Return 95 % of each parameter by the likelihood, noise held at its best.

    The region within 3.84 of the least −2 log likelihood is searched in boxes that grow or
    shrink to it; factors of least squares add 1.96 standard errors, and so do figures in which
    the response is a straight line, all others held.
    """
    found: list[tuple[FloatArray, FloatArray]] = []
    error = _factor_errors(base, fit)
    for point in _region(base, fit):
        factors = fit.factors
        if len(fit.point) and len(factors):
            factors = _factors_at(base, fit, point)
        found.append((point, factors))
    found += [(point, fit.factors) for point in _linear_ends(base, fit)]
    for sign in (-1.0, 1.0):
        for d in range(len(error)):
            moved = fit.factors.copy()
            moved[d] += sign * NORMAL * error[d]
            found.append((fit.point, moved))
    return _ends(base, fit.candidate, found)


def bootstrap_intervals(
    base: Baseline,
    fit: CandidateFit,
    resamples: int,
    random: np.random.Generator,
    progress: Callable[[float], None] | None = None,
) -> Intervals:
    """Return 95 % of each parameter by resampled blocks of innovations.

    Every resample is the fitted response with noise rebuilt from blocks of 25 innovations in
    random order, fitted again near the estimate. The interval is at least that of the
    likelihood.
    """
    found = []
    gap = base.run.gap
    response = fit.candidate.respond(base.run, fit.point[None, :])
    for b in range(resamples):
        drawn = gap.copy()
        for i in response.outputs:
            noise = fit.noise[i]
            fitted = gap[:, i] - noise.residual
            drawn[:, i] = fitted + _rebuilt(noise.innovations, noise.ar, random)
        again = fit_candidate(base, drawn, fit.candidate, fit.point if len(fit.point) else None)
        found.append((again.point, again.factors))
        if progress is not None:
            progress((b + 1) / resamples)
    values = [_parameters(base, fit.candidate, *each) for each in found]
    sure = likelihood_intervals(base, fit)
    ends: Intervals = {}
    for key in values[0]:
        low, high = np.quantile([v[key] for v in values], [0.025, 0.975])
        other = sure.get(key, (float(low), float(high)))
        ends[key] = (min(float(low), other[0]), max(float(high), other[1]))
    return ends


def chance_threshold(
    base: Baseline, candidates: tuple[Candidate, ...], random: np.random.Generator
) -> float:
    """Return the score that 95 % of records of the current model alone stay below.

    The innovations of the current model are drawn anew; every candidate's first grid is
    scored under its noise. It corrects for the number of candidates.
    """
    outputs = range(len(base.noise))
    rows = [base.blocks[i].train for i in outputs]
    drawn = [
        random.standard_normal((int(r.sum()), DRAWS)) * base.noise[i].innovation_std
        for i, r in enumerate(rows)
    ]
    bases = [
        projector(whitened_columns(base.columns[i], base.noise[i].ar, rows[i])) for i in outputs
    ]
    drawn = [left_by(q, each) for each, q in zip(drawn, bases, strict=True)]
    best = np.full(DRAWS, -np.inf)
    for candidate in candidates:
        if not candidate.inside:
            continue
        points = candidate.values(candidate.grid())
        response = candidate.respond(base.run, points)
        gain: FloatArray | float = 0.0
        for i in response.outputs:
            gain = gain + _chance_gain(
                base, response.shifts.get(i), response.sizes.get(i), i, drawn[i], bases[i]
            )
        count = np.array([candidate.count(point) for point in points])
        if response.possible is not None:
            gain = np.where(response.possible[:, None], gain, -np.inf)
        price = np.log(max(base.noise[0].rows, 2)) * count
        best = np.maximum(best, np.max(np.asarray(gain) - price[:, None], axis=0))
    return float(np.quantile(best, 0.95))


def _chance_gain(
    base: Baseline,
    shift: FloatArray | None,
    sizes: FloatArray | None,
    output: int,
    drawn: FloatArray,
    basis: FloatArray,
) -> FloatArray:
    """Return what every point gains on every draw, shape (G, DRAWS)."""
    ar, rows = base.noise[output].ar, base.blocks[output].train
    total = np.sum(drawn**2, axis=0)
    if shift is not None:
        wave = whitened_shifts(np.ascontiguousarray(shift), np.flatnonzero(rows), ar)
        wave = left_by(basis, wave)
        left = (-2.0 * wave.T) @ drawn
        left += np.einsum("ng,ng->g", wave, wave)[:, None]
        left += total
    else:
        assert sizes is not None
        count, points, factors = sizes.shape
        waves = whiten(sizes.reshape(count, -1), ar)[rows]
        waves = left_by(basis, waves).reshape(-1, points, factors)
        taken = []
        for g in range(points):
            inner = projector(waves[:, g])
            taken.append(np.sum((inner.T @ drawn) ** 2, axis=0))
        left = total - np.array(taken)
    return np.asarray(len(drawn) * np.log(total / np.maximum(left, 1e-300)))


def _region(base: Baseline, fit: CandidateFit) -> FloatArray:
    """Return searched points that the likelihood does not reject, shape (K, axes).

    Points are scattered in boxes that follow what is not rejected, as the likelihood of stems
    that rest and slip has many narrow peaks.
    """
    axes = fit.candidate.axes
    if not axes:
        return np.zeros((1, 0))
    centre = fit.candidate.coordinates(fit.point)
    free = [d for d, a in enumerate(axes) if a.step > 0.0 and not a.linear]
    if not free:
        return fit.candidate.values(centre[None, :])
    least = np.array([1.0 if axes[d].whole else 0.0 for d in free])
    width = np.maximum([FIRST_BOX * axes[d].step for d in free], least)
    halton = halton_sequence(len(free), seed=0)
    points, scores = np.zeros((0, len(axes))), np.zeros(0)
    for _ in range(BOXES):
        thrown = np.tile(centre, (SCATTERED + 1, 1))
        thrown[1:, free] += width * (2.0 * halton.random(SCATTERED) - 1.0)
        tried = _scored(base, fit, thrown)
        points, scores = np.vstack([points, tried[0]]), np.concatenate([scores, tried[1]])
        kept = points[scores - scores.min() <= CHI_SQUARE]
        reach = np.abs(kept[:, free] - centre[free]).max(axis=0, initial=0.0)
        width = np.maximum(np.clip(1.5 * reach, 0.3 * width, 3.0 * width), least)
    return fit.candidate.values(np.vstack([centre, _spread(kept)]))


def _linear_ends(base: Baseline, fit: CandidateFit) -> list[FloatArray]:
    """Return the ends of every linear figure, all others held, from its parabola of squares."""
    ends: list[FloatArray] = []
    ar = {i: noise.ar for i, noise in fit.noise.items()}
    rows = sum(int(base.blocks[i].train.sum()) for i in fit.noise)
    for d, axis in enumerate(fit.candidate.axes):
        if not axis.linear:
            continue
        reach = PROBE * max(abs(axis.low), abs(axis.high))
        tried = np.tile(fit.point, (3, 1))
        tried[:, d] += np.array([-reach, 0.0, reach])
        scores = misfit(base, base.run.gap, fit.candidate.respond(base.run, tried), ar)
        low, middle, high = np.exp(np.clip((scores - scores[1]) / max(rows, 1), None, 500.0))
        bend = 0.5 * (low - 2.0 * middle + high)  # of the squares, as a share of the least
        width = reach * np.sqrt(np.expm1(CHI_SQUARE / max(rows, 1)) / max(bend, TINY))
        for side in (-width, width):
            end = fit.point.copy()
            end[d] = np.clip(end[d] + side, axis.low, axis.high)
            if fit.candidate.possible(end[None, :]).all():
                ends.append(end)
    return ends


def _scored(
    base: Baseline, fit: CandidateFit, coordinates: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return coordinates, linear figures at their best, and the misfit there."""
    ar = {i: noise.ar for i, noise in fit.noise.items()}
    points = settled(base, base.run.gap, fit.candidate, coordinates, ar)
    response = fit.candidate.respond(base.run, fit.candidate.values(points))
    return points, misfit(base, base.run.gap, response, ar)


def _spread(points: FloatArray) -> FloatArray:
    """Return the points that are extreme in one coordinate, and some between."""
    ends = np.concatenate([points.argmin(axis=0), points.argmax(axis=0)])
    between = np.linspace(0, len(points) - 1, SHOWN).astype(int)
    return np.asarray(points[np.unique(np.concatenate([ends, between]))])


def _factor_errors(base: Baseline, fit: CandidateFit) -> FloatArray:
    """Return the standard errors of the factors, shape (s,)."""
    if not len(fit.factors):
        return np.zeros(0)
    response = fit.candidate.respond(base.run, fit.point[None, :])
    known = [
        information(sizes[:, 0], base.columns[i], fit.noise[i], base.blocks[i])
        for i, sizes in response.sizes.items()
    ]
    inverse = np.linalg.pinv(np.sum(known, axis=0))
    return np.asarray(np.sqrt(np.maximum(np.diag(inverse), 0.0)))


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


def _parameters(
    base: Baseline, candidate: Candidate, point: FloatArray, factors: FloatArray
) -> dict[str, float]:
    behaviour = candidate.behaviour(base.run, point, factors)
    assert behaviour is not None
    return figures_of(behaviour)


def _ends(
    base: Baseline, candidate: Candidate, found: list[tuple[FloatArray, FloatArray]]
) -> Intervals:
    values = [_parameters(base, candidate, *each) for each in found]
    return {key: (min(v[key] for v in values), max(v[key] for v in values)) for key in values[0]}


def _rebuilt(innovations: FloatArray, ar: FloatArray, random: np.random.Generator) -> FloatArray:
    """Return noise of the same length from blocks of innovations in random order."""
    count = len(innovations)
    begins = random.integers(0, max(count - BLOCK, 1), count // BLOCK + 1)
    drawn = np.concatenate([innovations[b : b + BLOCK] for b in begins])[:count]
    return coloured(drawn - drawn.mean(), ar)
