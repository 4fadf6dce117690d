"""The figures of one valve, from what the rates show and from its closed loop."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.closed_loop import ClosedLoop
from stiction_ros.identification.evidence.candidate import Candidate
from stiction_ros.identification.evidence.echoes import echo
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.output_fit import OutputFit, fit_output
from stiction_ros.identification.evidence.rates import Agreement, Look
from stiction_ros.identification.judgement.figures import NATS, Figures
from stiction_ros.identification.kernels.lags import whitened

FREEDOM = 4.0  # of Student's t: as heavy tails as have a finite spread of their own spread
NORMAL = 0.6745  # median of the absolute value of a standard normal variable


def figures_of(
    seen: Sequence[Look], agreed: Agreement, valve: int, closed: ClosedLoop
) -> Figures:
    """Return the figures of one valve.

    Args:
        seen: each rate.
        agreed: the rates that agree best on its friction.
        valve: index.
        closed: the loops, closed again with the best friction.
    """
    gains = [_gain(look, valve) for look in seen]
    pairs = [min(two) for two in itertools.pairwise(gains)]
    sees = [look for look in seen if look.sees_process(valve)] or list(seen)
    material = [0.5 * look.accepted[valve].material_gain for look in sees]
    strongest = seen[int(np.argmax(gains))]
    repeated = max(echo(look.problem, look.found.without[valve]) for look in seen)
    loop = closed.valves[valve]
    return Figures(
        gain=max(pairs, default=gains[0]),
        largest_gain=max(gains),
        robust_gain=_robust_gain(strongest, valve),
        ruled_out=-min(material),
        possible=max(material),
        repeats=repeated / (2.0 * (max(gains) + NATS)),
        loop_with=loop.moved_with,
        loop_without=loop.moved_without,
        loop_gone=loop.gone,
        band_share=loop.band_share,
        held=float(agreed.held),
        wave=0.5 * max(look.wave_gain or 0.0 for look in seen),
    )


def _gain(look: Look, valve: int) -> float:
    """Return the log likelihood that friction adds to its best rival at a rate, nats."""
    unanswered = _unanswered(look.problem, look.found.best, valve) - look.found.best.loss
    return 0.5 * min(look.accepted[valve].gain, unanswered)


def _unanswered(problem: Problem, best: Candidate, valve: int) -> float:
    """Return −2 log likelihood where PV does not answer a valve, the others as they are."""
    plain = dataclasses.replace(problem, tunings=())
    others = np.delete(best.stems, valve, axis=0)
    return sum(fit_output(plain, i, others, (fit,)).loss for i, fit in enumerate(best.fits))


def _robust_gain(look: Look, valve: int) -> float:
    """Return what friction adds where innovations follow Student's t, nats."""
    pairs = zip(look.found.without[valve].fits, look.found.best.fits, strict=True)
    first = look.problem.first
    return 0.5 * sum(_t_loss(rival, first) - _t_loss(fit, first) for rival, fit in pairs)


def _t_loss(fit: OutputFit, first: int) -> float:
    news: FloatArray = whitened(fit.noise, fit.rest, float(fit.rest[0]))[first:]
    scale = max(float(np.median(np.abs(news))) / NORMAL, 1e-300)
    tails = (FREEDOM + 1.0) * np.log1p((news / scale) ** 2 / FREEDOM)
    return float(2.0 * len(news) * np.log(scale) + tails.sum())
