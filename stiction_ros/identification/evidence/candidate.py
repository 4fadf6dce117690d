"""One choice of frictions, and what judges many of them at once."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.fit_kernels import Given, losses_of
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.output_fit import OutputFit, fit_output
from stiction_ros.identification.evidence.whitened import Whitened
from stiction_ros.identification.kernels.scan import rows_apart
from stiction_ros.identification.linear.response_prior import FREE

TOGETHER = 256
"""Stems that are simulated and judged in one go: few enough to be kept, and enough for laws that
are stepped for all of them at once, sample by sample."""


@dataclasses.dataclass(frozen=True)
class Candidate:
    """Frictions of all valves, and every output under them."""

    friction: FloatArray  # rows (f_S, f_D), shares of the span of OP, shape (m, 2)
    starts: FloatArray  # stem before the first sample minus the first OP, the same, shape (m,)
    stems: FloatArray  # scaled, shape (m, n)
    fits: tuple[OutputFit, ...]  # one per output

    def beginning(self, rows: int) -> "Candidate":
        """Return the candidate on the first ``rows`` of a record; what was fitted stays."""
        return dataclasses.replace(self, stems=np.ascontiguousarray(self.stems[:, :rows]))

    @property
    def loss(self) -> float:
        """Sum over the outputs."""
        return float(sum(fit.loss for fit in self.fits))


@dataclasses.dataclass(frozen=True)
class Judge:
    """What judges stems of one valve, all else given."""

    problem: Problem  # the record
    valve: int  # index
    # what stands beside them in each output, of each way to do it; the best counts
    ways: tuple[tuple[Given, ...], ...]

    @classmethod
    def of(
        cls,
        problem: Problem,
        beside: Candidate,
        valve: int,
        fits: Sequence[OutputFit],
        *,
        held: bool = False,
    ) -> "Judge":
        """Return what judges stems under the noise and prior of ``fits``.

        Args:
            problem: the record.
            beside: whose other valves are kept.
            valve: index.
            fits: one per output.
            held: whether responses may also get as far as in these fits, not only anywhere.
        """
        others = np.delete(beside.stems, valve, axis=0)
        whitened = [Whitened.of(problem, i, others, fit.noise, valve) for i, fit in enumerate(fits)]
        ways = [[dataclasses.replace(fit.prior, reach=FREE) for fit in fits]]
        if held:
            ways.append([fit.prior for fit in fits])
        given = (
            tuple(one.under(prior) for one, prior in zip(whitened, priors, strict=True))
            for priors in ways
        )
        return cls(problem, valve, tuple(given))

    def losses(self, rows: FloatArray) -> FloatArray:
        """Return the loss of many frictions, shape (G,).

        It is infinite where the valve hardly moves and beyond the largest friction.

        Args:
            rows: (f_S, f_D, start), shape (G, 3), further parameters of the law before the start.
        """
        problem, valve = self.problem, self.valve
        out = np.full(len(rows), np.inf)
        within = np.flatnonzero(rows[:, 0] <= problem.limit[valve])
        for begin in range(0, len(within), TOGETHER):
            some = within[begin : begin + TOGETHER]
            stems = problem.stems(valve, rows[some, :-1], rows[some, -1])
            found = np.array(
                [[losses_of(stems, one, problem.least_moves) for one in way] for way in self.ways]
            )
            out[some] = found.sum(axis=1).min(axis=0)
        return out


def ideal(problem: Problem) -> Candidate:
    """Return the best fit without friction from where fits without neighbours begin."""
    stems = problem.ideal_stems()
    fits = tuple(fit_output(problem, i, stems) for i in range(len(problem.pv)))
    return Candidate(np.zeros((len(stems), 2)), np.zeros(len(stems)), stems, fits)


def fitted_from(problem: Problem, known: Candidate, others: Sequence[Candidate]) -> Candidate:
    """Return a candidate, each output fitted from those of others too where that is better."""
    if not others:
        return known
    fits = []
    for i, fit in enumerate(known.fits):
        found = fit_output(problem, i, known.stems, [other.fits[i] for other in others])
        fits.append(min(fit, found, key=lambda one: one.loss))
    return dataclasses.replace(known, fits=tuple(fits))


def candidates_apart(
    met: Sequence[Candidate], valve: int, count: int, distance: float
) -> list[Candidate]:
    """Return the first of ``met``, best first, whose frictions of a valve are apart."""
    places = np.array([one.friction[valve] for one in met]).reshape(-1, 2)
    ranks = np.arange(len(met), dtype=float)
    return [met[i] for i in rows_apart(places, ranks, count, distance)]
