r"""One output under given stems: any smooth process, and autoregressive noise beside it.

.. math:: y_k = \sum_j \sum_{i=1}^{M} h^{(j)}_i \chi^{(j)}_{k-i} + c + w_k, \qquad
          D(q) w_k = \epsilon_k

with the prior of :mod:`.response_prior` on each h. Level and responses are integrated out, noise
and prior chosen such that −2 log of the marginal likelihood is least, in turns.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_triangular

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.kernels import (
    evidence,
    evidences,
    factorised,
    lagged,
    whitened,
)
from stiction_ros.identification.evidence.problem import NOISE_ORDER, Problem
from stiction_ros.identification.evidence.response_prior import ResponsePrior

ROUNDS = 6
SETTLED = 0.2  # of −2 log likelihood: a round that gains less is the last
TUNED = (0, 1, 3)  # rounds in which the prior is chosen anew
LOAD = 1e-8  # of the noise's variance, that keeps its equations regular


@dataclasses.dataclass(frozen=True)
class OutputFit:
    """One output.

    Attributes:
        noise: monic polynomial D, shape (d + 1,).
        prior: of the responses.
        loss: −2 log of the marginal likelihood, up to a constant of the rows.
        responses: of the scaled output to the scaled stems, shape (m, M).
        rest: what the free run leaves of the output, shape (n,).
    """

    noise: FloatArray
    prior: ResponsePrior
    loss: float
    responses: FloatArray
    rest: FloatArray


@dataclasses.dataclass(frozen=True)
class Criterion:
    """The loss of one output as a function of the stem of one valve, all else given.

    Attributes:
        noise, precision: D and the inverse of K.
        fixed, target, energy: see :func:`.kernels.evidence`.
        constant: what the loss adds to the kernel's.
    """

    noise: FloatArray
    precision: FloatArray
    fixed: FloatArray
    target: FloatArray
    energy: float
    constant: float

    def losses(self, stems: FloatArray) -> FloatArray:
        """Return the loss of each of many stems, scaled, shape (G, n)."""
        found = evidences(stems, self.noise, self.fixed, self.target, self.energy, self.precision)
        return np.asarray(found + self.constant)

    def best(self, stem: FloatArray) -> tuple[float, FloatArray]:
        """Return the loss of one stem and its response."""
        loss, response = evidence(
            stem, self.noise, self.fixed, self.target, self.energy, self.precision
        )
        return float(loss) + self.constant, response


@dataclasses.dataclass(frozen=True)
class Whitened:
    """One output and the stems beside one valve, whitened: what no prior changes.

    Attributes:
        noise: D.
        seen: the output, shape (n,).
        rows: a constant, then M lags of every other stem, shape (q, n).
        products: of these rows with each other, shape (q, q).
        taps: M.
    """

    noise: FloatArray
    seen: FloatArray
    rows: FloatArray
    products: FloatArray
    taps: int

    @classmethod
    def of(cls, problem: Problem, output: int, others: FloatArray, noise: FloatArray) -> Whitened:
        """Whiten an output and the stems of the ``others``, scaled, shape (m − 1, n)."""
        taps, first = problem.taps, problem.first
        y = problem.pv[output]
        seen = whitened(noise, y, float(y[0]))[first:]
        ones = np.full((1, len(seen)), float(noise.sum()) or 1.0)
        parts = [ones / np.linalg.norm(ones)]
        for stem in others:
            signal = whitened(noise, stem, float(stem[0]))
            parts.append(lagged(signal, float(signal[0]), first, taps))
        rows = np.vstack(parts)
        return cls(noise, seen, rows, rows @ rows.T, taps)

    def under(self, prior: ResponsePrior) -> Criterion:
        """Return the criterion under a prior, the others' responses integrated out."""
        precision, seen = prior.precision(self.taps), self.seen
        factor = self.products.copy()
        starts = range(1, len(factor), self.taps)
        for start in starts:
            block = slice(start, start + self.taps)
            factor[block, block] += precision
        determinant = factorised(factor)
        fixed = np.ascontiguousarray(
            solve_triangular(factor, self.rows, lower=True, check_finite=False)
        )
        explained = fixed @ seen
        return Criterion(
            noise=self.noise,
            precision=precision,
            fixed=fixed,
            target=seen - fixed.T @ explained,
            energy=float(seen @ seen - explained @ explained),
            constant=determinant + (1 + len(starts)) * prior.log_determinant(self.taps),
        )


def fit_output(
    problem: Problem, output: int, stems: FloatArray, starts: Sequence[OutputFit | None] = (None,)
) -> OutputFit:
    """Return the best fit that is reached from any of ``starts``.

    Args:
        problem: the record.
        output: index.
        stems: scaled, shape (m, n).
        starts: fits of neighbours; None begins with white noise.
    """
    found = [_descended(problem, output, stems, start) for start in starts]
    return min(found, key=lambda fit: fit.loss)


def follow(problem: Problem, output: int, stems: FloatArray, start: OutputFit) -> OutputFit:
    """Return ``start`` carried over to other stems: its prior, and its noise taken once anew."""
    kept = _fitted(problem, output, stems, start.noise, start.prior)
    noise = noise_of(kept.rest[problem.first - NOISE_ORDER :])
    return min(kept, _fitted(problem, output, stems, noise, start.prior), key=lambda f: f.loss)


def white(problem: Problem, output: int, stems: FloatArray, memory: float) -> OutputFit:
    """Return the fit under the noise 1 − ``memory`` q⁻¹, with the prior that suits it."""
    noise = np.array([1.0, -memory]) if memory else np.ones(1)
    prior = _tuned(problem, output, stems, noise, ResponsePrior())
    return _fitted(problem, output, stems, noise, prior)


def _descended(
    problem: Problem, output: int, stems: FloatArray, start: OutputFit | None
) -> OutputFit:
    noise = np.ones(1) if start is None else start.noise
    prior = ResponsePrior() if start is None else start.prior
    best = None if start is None else _fitted(problem, output, stems, noise, prior)
    last = np.inf
    for turn in range(ROUNDS):
        if turn in TUNED:
            prior = _tuned(problem, output, stems, noise, prior)
        rest = _fitted(problem, output, stems, noise, prior).rest
        noise = noise_of(rest[problem.first - NOISE_ORDER :])
        now = _fitted(problem, output, stems, noise, prior)
        if best is None or now.loss < best.loss:
            best = now
        if abs(last - now.loss) < SETTLED:
            break
        last = now.loss
    assert best is not None
    return best


def _tuned(
    problem: Problem, output: int, stems: FloatArray, noise: FloatArray, prior: ResponsePrior
) -> ResponsePrior:
    """Return the prior to which no neighbour is better, downhill from ``prior``."""
    beside = Whitened.of(problem, output, stems[1:], noise)
    met: dict[ResponsePrior, float] = {}

    def loss(one: ResponsePrior) -> float:
        if one not in met:
            met[one] = beside.under(one).best(stems[0])[0]
        return met[one]

    while True:
        better = min(prior.neighbours(), key=loss)
        if better == prior:
            return prior
        prior = better


def _fitted(
    problem: Problem, output: int, stems: FloatArray, noise: FloatArray, prior: ResponsePrior
) -> OutputFit:
    taps, y = problem.taps, problem.pv[output]
    responses = np.empty((len(stems), taps))
    loss = np.inf
    for j in range(len(stems)):
        beside = Whitened.of(problem, output, np.delete(stems, j, axis=0), noise)
        loss, responses[j] = beside.under(prior).best(stems[j])
    rest = y.copy()
    for stem, response in zip(stems, responses, strict=True):
        rest -= response @ lagged(stem, float(stem[0]), 0, taps)
    rest -= rest[problem.first :].mean()
    return OutputFit(noise, prior, float(loss), responses, rest)


def noise_of(rest: FloatArray) -> FloatArray:
    """Return the monic AR polynomial D of a signal, by least squares, shape (d + 1,)."""
    order = NOISE_ORDER
    past = np.array([rest[order - 1 - i : len(rest) - 1 - i] for i in range(order)])
    gram = past @ past.T + LOAD * float(rest @ rest) * np.eye(order)
    return np.append(1.0, -np.linalg.solve(gram, past @ rest[order:]))
