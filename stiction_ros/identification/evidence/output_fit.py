r"""One output under given stems: any smooth process, and autoregressive noise beside it.

.. math:: y_k = \sum_j \sum_{i=1}^{M} h^{(j)}_i \chi^{(j)}_{k-i} + c + w_k, \qquad
          D(q) w_k = \epsilon_k

with the prior of :mod:`...linear.response_prior` on each h, and a wave from outside where the
problem has one. Level and responses are integrated out, noise and prior chosen such that −2 log of
the marginal likelihood is least, in turns.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.fit_problem import NOISE_ORDER, Problem
from stiction_ros.identification.evidence.whitened import Whitened
from stiction_ros.identification.kernels.lags import answered
from stiction_ros.identification.linear.response_prior import FREE, REACHES, ResponsePrior
from stiction_ros.signals.autoregression import noise_of

OUTPUT_FIT_ROUNDS = 6
SETTLED = 0.2  # of −2 log likelihood: a round that gains less is the last
TUNED = (0, 1, 3)  # rounds in which the prior is chosen anew
BEGUN = (FREE, 1, 3, 5)  # reaches from which fits begin that have no neighbours


@dataclasses.dataclass(frozen=True)
class OutputFit:
    """One output."""

    noise: FloatArray  # monic polynomial D, shape (d + 1,)
    prior: ResponsePrior  # of the responses
    loss: float  # −2 log of the marginal likelihood, up to a constant of the rows
    # of the scaled output to the scaled stems, levels of the groups of taps, (m, r)
    responses: FloatArray
    rest: FloatArray  # what the free run leaves of the output, shape (n,)


def beginnings(problem: Problem, output: int) -> list[ResponsePrior]:
    """Return the priors from which a fit of an output begins without neighbours."""
    if problem.reaches[output] is None:
        return [ResponsePrior()]
    return [ResponsePrior(reach=reach) for reach in BEGUN]


def fit_output(
    problem: Problem,
    output: int,
    stems: FloatArray,
    starts: Sequence[OutputFit | ResponsePrior] = (),
) -> OutputFit:
    """Return the best fit that is reached from any of ``starts``.

    Args:
        problem: the record.
        output: index.
        stems: scaled, shape (m, n).
        starts: fits of neighbours, or priors beside white noise; of these :func:`beginnings`
            without any.
    """
    told = starts or beginnings(problem, output)
    found = [_descended(problem, output, stems, start) for start in told]
    best = min(found, key=lambda fit: fit.loss)
    if len(told) == 1 or problem.reaches[output] is None:
        return best
    return _reaching(problem, output, stems, best)


def _reaching(problem: Problem, output: int, stems: FloatArray, best: OutputFit) -> OutputFit:
    """Return the fit to which none with a reach beside its own is better, from ``best``."""
    met = {best.prior.reach}
    while True:
        for reach in (best.prior.reach - 1, best.prior.reach + 1):
            if reach in met or not 0 <= reach < len(REACHES):
                continue
            met.add(reach)
            prior = dataclasses.replace(best.prior, reach=reach)
            start = dataclasses.replace(best, prior=prior)
            found = _descended(problem, output, stems, start)
            if found.loss < best.loss:
                best = found
                break
        else:
            return best


def follow(problem: Problem, output: int, stems: FloatArray, start: OutputFit) -> OutputFit:
    """Return ``start`` carried over to other stems: its prior, and its noise by a step.

    How far the responses get is chosen anew.
    """
    whole = Whitened.of(problem, output, stems, start.noise)
    fit = _fitted(problem, output, whole, _reached(whole, start.prior))
    return min(fit, _stepped(problem, output, whole, fit)[1], key=lambda one: one.loss)


def _reached(whole: Whitened, prior: ResponsePrior) -> ResponsePrior:
    """Return the best of the priors that differ from ``prior`` in their reach alone."""
    if whole.reach is None:
        return prior
    tried = [dataclasses.replace(prior, reach=k) for k in (FREE, *range(len(REACHES)))]
    return tried[int(np.argmin(whole.losses(tried)))]


def white(problem: Problem, output: int, stems: FloatArray, memory: float) -> OutputFit:
    """Return the fit under the noise 1 − ``memory`` q⁻¹, with the prior that suits it."""
    noise = np.array([1.0, -memory]) if memory else np.ones(1)
    whole = Whitened.of(problem, output, stems, noise)
    return _fitted(problem, output, whole, _tuned(whole, ResponsePrior(reach=FREE)))


def _descended(
    problem: Problem, output: int, stems: FloatArray, start: OutputFit | ResponsePrior
) -> OutputFit:
    begins = isinstance(start, ResponsePrior)
    if isinstance(start, ResponsePrior):
        noise, prior = np.ones(1), start
    else:
        noise, prior = start.noise, start.prior
    whole = Whitened.of(problem, output, stems, noise)
    fit = _fitted(problem, output, whole, prior)
    best, settled = fit, False
    for turn in range(OUTPUT_FIT_ROUNDS):
        if settled or turn in TUNED:
            tuned = _tuned(whole, prior)
            if settled and tuned == prior:
                break
            if tuned != prior:
                prior = tuned
                fit = _fitted(problem, output, whole, prior)
        last = fit.loss
        whole, fit = _stepped(problem, output, whole, fit)
        settled = last - fit.loss < SETTLED
        if fit.loss < best.loss or (begins and turn == 0):
            best = fit
    return best


def _stepped(
    problem: Problem, output: int, whole: Whitened, fit: OutputFit
) -> tuple[Whitened, OutputFit]:
    """Return the fit after a step of noise and responses at once, as they stand in for each other.

    Where that is worse, the noise alone is taken anew.
    """
    first = _with_noise(problem, output, whole, fit, whole.noise_step(fit.prior, fit.rest))
    if first[1].loss < fit.loss + SETTLED:
        return first
    noise = noise_of(fit.rest[problem.first - NOISE_ORDER :], NOISE_ORDER)
    second = _with_noise(problem, output, whole, fit, noise)
    return min(first, second, key=lambda pair: pair[1].loss)


def _with_noise(
    problem: Problem, output: int, whole: Whitened, fit: OutputFit, noise: FloatArray
) -> tuple[Whitened, OutputFit]:
    again = Whitened.of(problem, output, whole.stems, noise)
    return again, _fitted(problem, output, again, fit.prior)


def _tuned(whole: Whitened, prior: ResponsePrior) -> ResponsePrior:
    """Return the prior to which no neighbour is better, downhill from ``prior``."""
    met: dict[ResponsePrior, float] = {}

    def best(tried: list[ResponsePrior]) -> ResponsePrior:
        fresh = [one for one in tried if one not in met]
        if fresh:
            met.update(zip(fresh, whole.losses(fresh).tolist(), strict=True))
        return min(tried, key=met.__getitem__)

    beside = len(whole.known.rows) > 1
    while True:
        better = best(prior.neighbours())
        if beside:
            better = best(better.neighbours(waves=True))
        if better == prior:
            return prior
        prior = better


def _fitted(problem: Problem, output: int, whole: Whitened, prior: ResponsePrior) -> OutputFit:
    loss, weights = whole.loss(prior)
    known = len(whole.known.rows)
    responses = weights[known:].reshape(len(whole.stems), len(problem.edges) - 1)
    rest = problem.pv[output].copy()
    for stem, levels in zip(whole.stems, responses, strict=True):
        rest -= answered(stem, problem.taps_of(levels))
    if known > 1:
        sines, cosines = weights[1:known].reshape(2, -1)
        sizes = (cosines - 1j * sines) / whole.passed
        rest -= np.concatenate([-sizes.imag, sizes.real]) @ problem.waves[output]
    rest -= rest[problem.first :].mean()
    return OutputFit(whole.noise, prior, loss, responses, rest)
