"""Whether what is left of an output repeats itself: a wave from outside that keeps no exact time.

What the best fit leaves, made white, knows nothing of itself some time earlier. Where it does, PV
does once more what it did a turn ago, and neither the valve nor the noise says why: another loop
that cycles, or a load that swings at no exact time. Such a wave moves OP in time with it, as a
friction does, and no line of one period stands for it.
"""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.candidate import Candidate
from stiction_ros.identification.evidence.fit_problem import NOISE_ORDER, Problem
from stiction_ros.signals.autoregression import innovations

SHORTEST = NOISE_ORDER + 4  # rows of a turn: the noise model describes shorter ones
LONGEST = 0.25  # of the rows
SPREADS = ((1.0,), (0.25, 0.5, 0.25))
"""Weights of neighbouring lags, as turns are not of one length."""


def echo(problem: Problem, candidate: Candidate) -> float:
    r"""Return how strongly what a candidate leaves of an output repeats itself, the most of all.

    .. math:: \max_P n \, r_P^2

    over the lags P of a tenth row to a quarter of the record, with r_P > 0 the autocorrelation of
    n innovations, or its weighted mean over three lags. Where they are white the most of a thousand
    lags exceeds 20 in one record of 250.

    Args:
        problem: the record at one rate.
        candidate: whose fits are judged.
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
