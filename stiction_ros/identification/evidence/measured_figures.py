"""The figures of one valve, from what the rates show and from its closed loop."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.closed_loop import ClosedLoop
from stiction_ros.identification.evidence.candidate import Candidate
from stiction_ros.identification.evidence.fit_problem import NOISE_ORDER, Problem
from stiction_ros.identification.evidence.output_fit import fit_output
from stiction_ros.identification.evidence.rates import Agreement, Look
from stiction_ros.identification.judgement import Figures
from stiction_ros.records.valve_work import ValveWork
from stiction_ros.signals.autoregression import innovations
from stiction_ros.signals.oscillation import turnings

SHORTEST = NOISE_ORDER + 4  # rows of a turn: the noise model describes shorter ones
LONGEST = 0.25  # of the rows
SPREADS = ((1.0,), (0.25, 0.5, 0.25))
"""Weights of neighbouring lags, as turns are not of one length."""
ENDLESS = 100.0  # unevenness of an OP that has no two half cycles
FEW = 2.0
"""Nats added to a gain of which a ratio is taken: what two parameters gain by chance."""


def responds(seen: Sequence[Look], silent: Sequence[float], valve: int, confidence: float) -> bool:
    """Return whether PV answers a valve: else the stem is stuck, it is bypassed, a tag is wrong.

    At some rate friction gains its price over a PV that does not answer, or an ideal valve makes
    the record 1 / (1 − ``confidence``) times as likely.

    Args:
        seen: each rate.
        silent: :func:`loss_without_response` at each.
        valve: index.
        confidence: 0 to 1, of the intervals.
    """
    least = -2.0 * math.log(1.0 - confidence)
    for look, loss in zip(seen, silent, strict=True):
        best, ideal = look.found.best, look.found.without[valve]
        if loss - best.loss > look.price or loss - ideal.loss > least:
            return True
    return False


def loss_without_response(look: Look, valve: int) -> float:
    """Return −2 log likelihood where PV does not answer a valve, the others as they are."""
    best, plain = look.found.best, dataclasses.replace(look.problem, tunings=())
    others = np.delete(best.stems, valve, axis=0)
    return sum(fit_output(plain, i, others, (fit,)).loss for i, fit in enumerate(best.fits))


def echo(problem: Problem, candidate: Candidate) -> float:
    r"""Return how strongly what a candidate leaves of an output repeats itself, the most of all.

    .. math:: \max_P n \, r_P^2

    over the lags P of a tenth row to a quarter of the record, with r_P > 0 the autocorrelation of
    n innovations, or its weighted mean over three lags. Where they are white the most of a thousand
    lags exceeds 20 in one record of 250. Where they are not, neither valve nor noise says why:
    another loop cycles, or a load swings at no exact time, in time with which OP moves as well.
    """
    longest = int(LONGEST * problem.rows)
    return max(
        _strongest(innovations(fit.noise, fit.rest)[problem.first :], longest)
        for fit in candidate.fits
    )


def _strongest(news: FloatArray, longest: int) -> float:
    if longest <= SHORTEST:
        return 0.0
    around = news - news.mean()
    energy = max(float(around @ around), 1e-300)
    spectrum = np.abs(np.fft.rfft(around, 2 * len(around))) ** 2
    alike = np.fft.irfft(spectrum)[: longest + 1] / energy
    shown = [np.convolve(alike, one, mode="same") / np.linalg.norm(one) for one in SPREADS]
    most = max(float(one[SHORTEST:-1].max(initial=0.0)) for one in shown)
    return len(news) * max(most, 0.0) ** 2


def figures_of(
    seen: Sequence[Look], silent: Sequence[float], agreed: Agreement, valve: int, closed: ClosedLoop
) -> Figures:
    """Return the figures of one valve.

    Args:
        seen: each rate.
        silent: −2 log likelihood at each where PV does not answer the valve.
        agreed: the rates that agree best on its friction.
        valve: index.
        closed: the loops, closed again with the best friction.
    """
    gains = [_gain(look, loss, valve) for look, loss in zip(seen, silent, strict=True)]
    sees = [look for look in seen if look.sees_process(valve)] or list(seen)
    material = [0.5 * look.accepted[valve].material_gain for look in sees]
    repeated = max(echo(look.problem, look.found.without[valve]) for look in seen)
    loop = closed.valves[valve]
    beyond = 0.5 * min(agreed.gain, 2.0 * max(gains))
    low, high = agreed.look.accepted[valve].band
    stem = agreed.look.found.best.stems[valve]
    unevenness, kurtosis = shape_of(seen[0].problem.op[valve])
    return Figures(
        gain=beyond if agreed.alike else min(beyond, 0.0),
        ruled_out=-max(material),
        repeats=0.5 * repeated / (max(gains) + FEW),
        loop_gone=loop.gone,
        stem_rest=agreed.look.problem.rows / (ValveWork.of(stem).reversals + 1.0),
        controller_fit=0.0 if loop.controller is None else loop.controller.r_squared,
        band_width=1.0 - low / high if high > 0.0 else 0.0,
        op_unevenness=unevenness,
        op_kurtosis=kurtosis,
    )


def shape_of(op: FloatArray) -> tuple[float, float]:
    """Return how uneven the half cycles of OP are, and its kurtosis; OP moves, shape (n,).

    A half cycle ends where OP goes beyond half its standard deviation on the other side.
    """
    away = (op - op.mean()) / op.std()
    halves = np.diff(turnings(away, 0.5))
    uneven = float(halves.std() / halves.mean()) if len(halves) > 1 else ENDLESS
    return uneven, float(np.mean(away**4))


def _gain(look: Look, silent: float, valve: int) -> float:
    """Return the nats by which friction beats an ideal valve and a PV that does not answer."""
    return 0.5 * min(look.accepted[valve].gain, silent - look.found.best.loss)
