"""How much OP moves about its slow mean, and at which period."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.oscillation import slow_mean, turnings

ALIKE = (0.5, 1.7)
"""Movement of OP over the recorded one that is the same cycle."""

SAME_PERIOD = 1.6
"""Factor within which the periods of two cycles are the same."""

SLOW = 3.0
"""Periods over which the slow mean is taken."""

LATE = 0.6
"""Share of a run, at its end, that is looked at."""

FAST = 8.0
"""Parts of a period over which noise is averaged out."""


@dataclasses.dataclass(frozen=True)
class Movement:
    """How OP moved in simulated runs, over how it was recorded.

    Attributes:
        ratio: median of the runs; infinite where they grow without end.
        low, high: quartiles.
        alike: share of the runs that move as recorded, with about the recorded period.
        period: median of the runs that move over the recorded one; 0 where none does.
    """

    ratio: float
    low: float
    high: float
    alike: float
    period: float


STILL = Movement(0.0, 0.0, 0.0, 0.0, 0.0)


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


def _size_and_period(run: FloatArray, late: int) -> tuple[float, float]:
    """Return root mean square and samples per cycle of a run about its mean.

    The period is 0 with less than one cycle; a run that is not finite has no period and an
    infinite size.

    Args:
        run: shape (n,).
        late: first sample that counts.
    """
    if not np.isfinite(run).all():
        return np.inf, 0.0
    away = run[late:] - run[late:].mean()
    at = turnings(away, 0.5 * size(away))
    return size(away), 2.0 * float(at[-1] - at[0]) / (len(at) - 1) if len(at) > 2 else 0.0


def gone(stuck: float, free: float) -> float:
    """Return the share of a movement that is gone where it is another one without a friction."""
    return max(0.0, 1.0 - free / stuck) if 0.0 < stuck < np.inf else 0.0


def compare(runs: FloatArray, recorded: float, period: float) -> Movement:
    """Return how OP moves at the end of runs.

    Args:
        runs: OP of R runs, shape (R, n).
        recorded: size of the recorded movement, units of OP.
        period: recorded one, samples.
    """
    late = int((1.0 - LATE) * runs.shape[1])
    sizes, periods = np.array([_size_and_period(run, late) for run in runs]).T
    ratio, own = sizes / recorded, periods / period
    same = (own > 1.0 / SAME_PERIOD) & (own < SAME_PERIOD)
    alike = (ratio > ALIKE[0]) & (ratio < ALIKE[1]) & same
    going = own[(own > 0.0) & (ratio > 0.2)]
    low, middle, high = np.sort(ratio)[[len(ratio) // 4, len(ratio) // 2, 3 * len(ratio) // 4]]
    return Movement(
        float(middle),
        float(low),
        float(high),
        float(alike.mean()),
        float(np.median(going)) if len(going) else 0.0,
    )
