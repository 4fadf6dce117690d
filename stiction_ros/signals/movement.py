"""How much a signal moves about its slow mean."""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.oscillation import slow_mean

SLOW = 3.0
"""Periods over which the slow mean is taken."""

FAST = 8.0
"""Parts of a period over which noise is averaged out."""


def moving(values: FloatArray, period: float) -> FloatArray:
    """Return ``values``, shape (N,), about their slow mean and without their fast noise."""
    fast = slow_mean(values, period / FAST) if period >= 2 * FAST else values
    return fast - slow_mean(values, SLOW * period)


def size(moved: FloatArray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(moved**2)))
