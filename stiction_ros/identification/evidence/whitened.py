"""One output and stems, whitened by a given noise: what no prior changes, and any prior's loss."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.evidence.fit_kernels import (
    LEAST,
    Given,
    Known,
    Lines,
    beside_lines,
    beside_prior,
    evidences_of,
    factorised,
    solved,
)
from stiction_ros.identification.evidence.fit_problem import NOISE_ORDER, Problem
from stiction_ros.identification.kernels.lags import (
    Products,
    answered,
    beside_lags,
    products_of,
    step_products,
)
from stiction_ros.identification.linear.response_prior import Held, Reach, ResponsePrior
from stiction_ros.signals.autoregression import LOAD, innovations

ComplexArray = NDArray[np.complex128]


def energy_of(signal: FloatArray) -> float:
    """Return the sum of squares."""
    return float(signal @ signal)


@dataclasses.dataclass(frozen=True)
class Whitened:
    """One output and some stems, whitened: what no prior changes."""

    noise: FloatArray  # D
    seen: FloatArray  # the output, shape (n,)
    known: Lines  # a constant and waves from outside: a wave stays one when it is whitened
    passed: ComplexArray  # what D makes of each harmonic, complex, shape (H,)
    stems: FloatArray  # scaled, shape (m, N)
    lags: Products  # of the stems, with each other and with the output
    products: FloatArray  # of ``known`` and of the lags of every stem with each other, shape (q, q)
    seen_products: FloatArray  # of these with the output, shape (q,)
    edges: IntArray  # of the groups of taps
    reach: Reach | None  # how far the response of one of the valves is expected to get, or None
    at: int  # index in ``stems`` of the one whose response it is; −1 where that is not among them

    @classmethod
    def of(
        cls,
        problem: Problem,
        output: int,
        stems: FloatArray,
        noise: FloatArray,
        without: int | None = None,
    ) -> "Whitened":
        """Whiten an output and the stems beside it.

        Args:
            problem: the record.
            output: index.
            stems: scaled, shape (m, N), or of all valves but one; there may be none.
            noise: D.
            without: index of the valve that is left out.
        """
        y = problem.pv[output]
        seen = innovations(noise, y)[problem.first :]
        known = problem.known[output]
        lags = products_of(noise, stems, seen[None], problem.edges)
        count, size = len(known.rows), len(problem.edges) - 1
        products = np.empty((count + len(lags.shared),) * 2)
        products[:count, :count] = known.gram
        for begin, past in zip(range(count, len(products), size), lags.past, strict=True):
            beside = beside_lines(past, known, problem.edges)
            products[begin : begin + size, :count] = beside
            products[:count, begin : begin + size] = beside.T
        products[count:, count:] = lags.shared
        seen_products = np.concatenate([known.rows @ seen, lags.beside[0]])
        turns = np.outer(problem.turns(output), np.arange(len(noise)))
        passed = np.exp(-1j * turns) @ noise
        reach, at = problem.reaches[output], -1
        if reach is not None and reach.valve != without:
            at = reach.valve - (without is not None and without < reach.valve)
        return cls(
            noise,
            seen,
            known,
            passed,
            stems,
            lags,
            products,
            seen_products,
            problem.edges,
            reach,
            at,
        )

    def wave_variances(self, prior: ResponsePrior) -> FloatArray:
        """Return the variances of the sines and cosines, whitened, over σ², shape (2 H,)."""
        harmonics = np.arange(1, len(self.passed) + 1)
        return np.tile(prior.wave_variances(harmonics) * np.abs(self.passed) ** 2, 2)

    def held(self, prior: ResponsePrior) -> Held | None:
        """Return the response that is held; None where none is expected to get anywhere."""
        return None if self.reach is None else prior.held(self.edges, self.reach)

    def block(self, valve: int) -> slice:
        """Return where the lags of a stem stand among what explains the output."""
        size = len(self.edges) - 1
        return slice(len(self.known.rows) + valve * size, len(self.known.rows) + (valve + 1) * size)

    def before(self, priors: Sequence[ResponsePrior]) -> Known:
        """Return what is known before the record, under each of several priors, one at least."""
        size, count = len(self.edges) - 1, len(priors)
        helds = [self.held(prior) for prior in priors] if self.at >= 0 else []
        told = [held for held in helds if held is not None]
        waves = np.empty((count, len(self.known.rows) - 1))
        if len(self.passed):  # few records have any, and this is called tens of thousands of times
            waves[:] = [1.0 / self.wave_variances(prior) for prior in priors]
        return Known(
            precisions=np.array([prior.precision(self.edges) for prior in priors]),
            waves=waves,
            held=np.array([held.precision for held in told]).reshape(-1, size, size),
            pulls=np.array([held.pull for held in told]).reshape(-1, size),
            energies=np.array([held.energy for held in told]) if told else np.zeros(count),
            at=self.block(self.at).start if told else -1,
        )

    def equations(self, prior: ResponsePrior) -> tuple[FloatArray, FloatArray, float]:
        """Return what is known before the record with the products, those with y, and y's energy.

        Shapes (q, q) and (q,).
        """
        known = self.before([prior])
        out, seen = beside_prior(self.products, self.seen_products, known, 0)
        return out, seen, energy_of(self.seen) + float(known.energies[0])

    def log_determinant(self, prior: ResponsePrior) -> float:
        """Return log det of the prior covariance of everything but the constant."""
        waves = float(np.log(self.wave_variances(prior)).sum()) if len(self.passed) else 0.0
        held = self.held(prior)
        known = 0.0 if held is None else held.determinant
        return waves + len(self.stems) * prior.log_determinant(self.edges) + known

    def loss(self, prior: ResponsePrior) -> tuple[float, FloatArray]:
        """Return the loss, and what multiplies ``known`` and each lag, shape (q,)."""
        factor, seen, energy = self.equations(prior)
        determinant = factorised(factor) + self.log_determinant(prior)
        weights, explained = solved(factor, seen)
        count = len(self.seen)
        left = max(energy - explained, LEAST * energy_of(self.seen))
        return float(count * np.log(left / count) + determinant), weights

    def losses(self, priors: Sequence[ResponsePrior]) -> FloatArray:
        """Return the loss of each of several priors, one at least, shape (K,)."""
        energy, known = energy_of(self.seen), self.before(priors)
        found = evidences_of(self.products, self.seen_products, energy, len(self.seen), known)
        return np.asarray(found + [self.log_determinant(prior) for prior in priors])

    def noise_step(self, prior: ResponsePrior, rest: FloatArray) -> FloatArray:
        """Return D after a Gauss-Newton step in D, responses and level together, shape (d + 1,).

        Args:
            prior: of the responses.
            rest: what the free run of the best fit leaves of the output, shape (N,).
        """
        first = len(rest) - len(self.seen)
        lags = range(1, NOISE_ORDER + 1)
        past = np.array([rest[first - i : len(rest) - i] for i in lags])
        equations, seen, _ = self.equations(prior)
        beside = beside_lags(self.noise, self.stems, past, self.edges)
        cross = np.hstack([past @ self.known.rows.T, beside])
        solution = np.linalg.solve(equations, np.column_stack([cross.T, seen]))
        gram = past @ past.T
        gram += LOAD * energy_of(rest) * np.eye(NOISE_ORDER)
        step = np.linalg.solve(
            gram - cross @ solution[:, :-1], cross @ solution[:, -1] - past @ self.seen
        )
        out = np.append(0.0, step)
        out[: len(self.noise)] += self.noise
        return out

    def under(self, prior: ResponsePrior) -> Given:
        """Return what judges one more stem beside these, their responses integrated out."""
        equations, seen, energy = self.equations(prior)
        factor = np.linalg.cholesky(equations)
        root = solve_triangular(factor, np.eye(len(factor)), lower=True, check_finite=False)
        half = root @ seen
        weights = root.T @ half
        target = self.seen - weights[: len(self.known.rows)] @ self.known.rows
        levels = weights[len(self.known.rows) :].reshape(len(self.stems), len(self.edges) - 1)
        for past, level in zip(self.lags.past, levels, strict=True):
            target -= answered(past, np.repeat(level, np.diff(self.edges)))[-len(target) :]
        energy -= float(half @ half)
        precision, pull = prior.precision(self.edges), np.zeros(len(self.edges) - 1)
        held = self.held(prior) if self.at < 0 else None
        if held is not None:  # the response of the stem that is judged
            precision, pull, energy = precision + held.precision, held.pull, energy + held.energy
        determinant = 2.0 * float(np.log(np.diag(factor)).sum()) + self.log_determinant(prior)
        rows, taps = self.stems.shape[1], int(self.edges[-1])
        noise, count = self.noise, len(self.seen)
        return Given(
            noise=noise,
            judged=count,
            lines=self.known,
            others=self.stems,
            beside=self.lags.past,
            others_first=self.lags.first,
            root=np.ascontiguousarray(root),
            target=step_products(noise, target, rows, taps),
            pull=pull,
            energy=energy,
            edges=self.edges,
            precision=precision,
            constant=determinant + prior.log_determinant(self.edges),
        )
