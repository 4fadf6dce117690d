r"""The probability of friction, and the verdict as two cuts through it.

.. math:: \log \frac{P}{1 - P} = c_0 + \sum_i c_i x_i

with the features x of :meth:`.figures.Figures.features`. The coefficients stand in
``friction_probability.yaml``; ``stiction calibrate`` of stiction-studies fits them to simulated
loops whose valves are known.
"""

from __future__ import annotations

import functools
from importlib.resources import files

import numpy as np
import yaml

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.judgement.figures import Figures, definitions
from stiction_ros.identification.result.verdict_kind import VerdictKind

FILE = "friction_probability.yaml"
SURE = 0.95
"""Probability from which on a verdict is given: one wrong verdict in twenty at the cut."""


@functools.cache
def coefficients() -> FloatArray:
    """Return c_0 and the coefficient of each figure, in their order, shape (1 + F,)."""
    text = files("stiction_ros.identification.judgement").joinpath(FILE).read_text("utf-8")
    fitted = yaml.safe_load(text)
    return np.array([fitted["constant"], *(fitted["figures"][name] for name in definitions())])


def friction_probability(figures: Figures) -> float:
    """Return the probability that a valve has friction that matters, 0 to 1."""
    constant, *slopes = coefficients()
    odds = constant + float(np.array(slopes) @ figures.features())
    return float(1.0 / (1.0 + np.exp(-np.clip(odds, -30.0, 30.0))))


def contributions(figures: Figures) -> dict[str, float]:
    """Return what each figure adds to the log odds, by name."""
    parts = coefficients()[1:] * figures.features()
    return dict(zip(definitions(), parts.tolist(), strict=True))


def verdict_of(probability: float, figures: Figures, deadband: bool) -> VerdictKind:
    """Return the verdict by a probability.

    Args:
        probability: of friction.
        figures: a valve is healthy only where the record also rules out friction that would matter.
        deadband: whether the friction has no jump.
    """
    if probability >= SURE:
        return VerdictKind.BACKLASH if deadband else VerdictKind.STICKY
    if probability <= 1.0 - SURE and figures.ruled_out > 0.0:
        return VerdictKind.HEALTHY
    return VerdictKind.UNDECIDED
