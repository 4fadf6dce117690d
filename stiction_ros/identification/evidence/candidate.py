"""One choice of frictions, and what judges many of them at once."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.output_fit import (
    OutputFit,
    Whitened,
    beginnings,
    fit_output,
)
from stiction_ros.identification.evidence.problem import Problem
from stiction_ros.identification.kernels.scan import best_apart
from stiction_ros.identification.linear.response_prior import FREE, ResponsePrior

TOGETHER = 256
"""Stems that are simulated and judged in one go: few enough to be kept, and enough for laws that
are stepped for all of them at once, sample by sample."""


@dataclasses.dataclass(frozen=True)
class Candidate:
    """Frictions of all valves, and every output under them.

    Attributes:
        friction: rows (f_S, f_D), shares of the span of OP, shape (m, 2).
        starts: stem before the first sample minus the first OP, the same, shape (m,).
        stems: scaled, shape (m, n).
        fits: one per output.
    """

    friction: FloatArray
    starts: FloatArray
    stems: FloatArray
    fits: tuple[OutputFit, ...]

    def beginning(self, rows: int) -> Candidate:
        """Return the candidate on the first ``rows`` of a record; what was fitted stays."""
        return dataclasses.replace(self, stems=np.ascontiguousarray(self.stems[:, :rows]))

    @property
    def loss(self) -> float:
        """Sum over the outputs."""
        return float(sum(fit.loss for fit in self.fits))


def losses(
    problem: Problem,
    beside: Candidate,
    valve: int,
    rows: FloatArray,
    fits: Sequence[OutputFit],
    *,
    held: bool = False,
) -> FloatArray:
    """Return the loss of many frictions of one valve, shape (G,).

    It is infinite where the valve hardly moves and beyond the largest friction.

    Args:
        problem: the record.
        beside: whose other valves are kept.
        valve: index.
        rows: (f_S, f_D, start), shape (G, 3), further parameters of the law before the start.
        fits: whose noise and prior are taken.
        held: whether responses get as far as in these fits; otherwise each as far as it may.
    """
    priors = [fit.prior if held else dataclasses.replace(fit.prior, reach=FREE) for fit in fits]
    others = np.delete(beside.stems, valve, axis=0)
    judges = [
        Whitened.of(problem, i, others, fit.noise, valve).under(prior)
        for i, (fit, prior) in enumerate(zip(fits, priors, strict=True))
    ]
    out = np.full(len(rows), np.inf)
    within = np.flatnonzero(rows[:, 0] <= problem.limit[valve])
    for begin in range(0, len(within), TOGETHER):
        some = within[begin : begin + TOGETHER]
        stems = problem.stems(valve, rows[some, :-1], rows[some, -1])
        out[some] = sum(judge.losses(stems, problem.least_moves) for judge in judges)
    return out


def rows_apart(places: FloatArray, found: FloatArray, count: int, distance: float) -> list[int]:
    """Return the best of ``places``; what lies just at the distance, as in a grid, is too near."""
    beyond = float(np.nextafter(distance, np.inf))
    return [int(i) for i in best_apart(places, found, count, beyond)]


def ideal(problem: Problem, starts: Iterable[Sequence[OutputFit]] = ()) -> Candidate:
    """Return the best fit without friction, from white noise and from ``starts``."""
    stems = problem.ideal_stems()
    begun: list[list[OutputFit | ResponsePrior]] = [
        [*beginnings(problem, i)] for i in range(len(problem.pv))
    ]
    for fits in starts:
        for row, fit in zip(begun, fits, strict=True):
            row.append(fit)
    fits = tuple(fit_output(problem, i, stems, row) for i, row in enumerate(begun))
    return Candidate(np.zeros((len(stems), 2)), np.zeros(len(stems)), stems, fits)


def candidates_apart(
    met: Sequence[Candidate], valve: int, count: int, distance: float
) -> list[Candidate]:
    """Return the first of ``met``, best first, whose frictions of a valve are apart."""
    places = np.array([one.friction[valve] for one in met]).reshape(-1, 2)
    ranks = np.arange(len(met), dtype=float)
    return [met[i] for i in rows_apart(places, ranks, count, distance)]
