"""How much OP moves about its slow mean."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.oscillation import slow_mean

SLOW = 3.0
"""Periods over which the slow mean is taken."""

FAST = 8.0
"""Parts of a period over which noise is averaged out."""


@dataclasses.dataclass(frozen=True)
class Moved:
    """How a loop moves when its record is repeated, between moves of its set-point.

    Attributes:
        with_friction, without_friction: movement of OP over the recorded one.
        gone: share that goes away with the friction, of OP's movement or of that of PV − SP,
            whichever is more: a controller that passes noise on to the valve moves OP anyway,
            and one that is slow hardly moves it at all.
    """

    with_friction: float
    without_friction: float
    gone: float


def moving(values: FloatArray, period: float) -> FloatArray:
    """Return ``values``, shape (N,), about their slow mean and without their fast noise."""
    fast = slow_mean(values, period / FAST) if period >= 2 * FAST else values
    return fast - slow_mean(values, SLOW * period)


def size(moved: FloatArray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(moved**2)))


def gone(stuck: float, free: float) -> float:
    """Return the share of a movement that is gone where it is another one without a friction."""
    return max(0.0, 1.0 - free / stuck) if 0.0 < stuck < np.inf else 0.0
