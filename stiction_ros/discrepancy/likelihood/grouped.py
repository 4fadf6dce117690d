"""The likelihood of rounded values: each tells only in which step of the lattice it lies."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.likelihood.noise import SURPRISE, Blocks, NoiseFit
from stiction_ros.effects import FloatArray

STEPS = 24  # of the golden section
SMALLEST = 0.02  # σ over the quantum
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_ROOT = math.sqrt(2.0)
_LEAST = 1e-12


def grouped(fit: NoiseFit, quantum: float, blocks: Blocks) -> NoiseFit:
    r"""Return a fit whose likelihood is that of values rounded to a quantum.

    .. math::
        -2 \log L = -2 \sum_k \log \frac{1}{q} \left[ \Phi\left(\frac{e_k + q/2}{\sigma}\right)
        - \Phi\left(\frac{e_k - q/2}{\sigma}\right) \right]

    with σ at its best. What lies within half a quantum is explained already: nothing gains by
    following the lattice.

    Args:
        fit: under Gaussian noise.
        quantum: q, > 0, units of the output.
        blocks: rows that are fitted and kept back.
    """
    white = fit.innovations
    inside = np.ascontiguousarray(white[blocks.train])
    low = math.log(SMALLEST * quantum)
    high = math.log(max(3.0 * float(np.std(inside)), 2.0 * SMALLEST * quantum))
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a, at_b = (_minus_two_log(inside, quantum, math.exp(x), np.inf) for x in (a, b))
    for _ in range(STEPS):
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = _minus_two_log(inside, quantum, math.exp(a), np.inf)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = _minus_two_log(inside, quantum, math.exp(b), np.inf)
    spread = math.exp(0.5 * (low + high))
    held = np.ascontiguousarray(white[blocks.held])
    return dataclasses.replace(
        fit,
        minus_two_log=min(at_a, at_b),
        held_minus_two_log=_minus_two_log(held, quantum, spread, SURPRISE),
    )


def best_noise(
    fits: Sequence[NoiseFit], quantum: float = 0.0, blocks: Blocks | None = None
) -> NoiseFit:
    """Return the fit of least BIC, by the likelihood of rounded values where there is a quantum."""
    if quantum > 0.0 and blocks is not None:
        fits = [grouped(fit, quantum, blocks) for fit in fits]
    return min(fits, key=lambda fit: fit.bic(0))


@compiled
def _minus_two_log(white: FloatArray, quantum: float, spread: float, most: float) -> float:
    """Return −2 log likelihood of grouped innovations, each at most ``most`` σ off its group."""
    total = 0.0
    half = 0.5 * quantum
    for k in range(len(white)):
        away = min(abs(white[k]), half + most * spread)
        upper = 0.5 * math.erfc((away - half) / spread / _ROOT)
        lower = 0.5 * math.erfc((away + half) / spread / _ROOT)
        share = upper - lower
        if share > _LEAST:
            total -= 2.0 * math.log(share / quantum)
        else:
            beyond = (away - half) / spread
            total += beyond * beyond - 2.0 * math.log(_LEAST / quantum)
    return total
