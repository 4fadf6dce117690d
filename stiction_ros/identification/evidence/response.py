"""Whether PV answers a valve at all: a rival in which its stem has no effect.

Where that rival is not beaten, the stem is stuck, the valve is bypassed, or a tag is the wrong one.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.identification.evidence.output_fit import fit_output
from stiction_ros.identification.evidence.rates import Look


def responds(seen: Sequence[Look], silent: Sequence[float], valve: int, confidence: float) -> bool:
    """Return whether PV answers a valve, as far as a record shows.

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
