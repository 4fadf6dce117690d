"""When the cycles of a loop begin, and whether two loops keep the same time."""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.oscillation import moving, size, turnings

MOST = 200  # beats that are kept of a record, the last ones
FEWEST = 5  # beats of one loop from which two can be compared
ALIKE = 0.05  # logarithm of the ratio of two periods up to which they may be the same

LOCKED = 0.85
"""Mean resultant length of the phases from which on two loops keep the same time: 1 is to the
sample; two cycles of their own that part by half a turn within the record come to .64."""


def beats(error: FloatArray, period: float) -> FloatArray:
    """Return the samples, not whole, at which PV − SP, (N,), sets out upwards through its mean."""
    moved = moving(error, period)
    rows = []
    for k in turnings(moved, 0.3 * size(moved)).tolist():
        if moved[k] > 0.0:
            a = int(np.flatnonzero(moved[:k] <= 0.0)[-1])
            rows.append(a + float(moved[a] / (moved[a] - moved[a + 1])))
    return np.array(rows[-MOST:])


def locked(one: FloatArray, other: FloatArray) -> bool:
    """Tell whether two loops' beats, s on one clock, keep the same time: one begins at one phase.

    References:
        K. V. Mardia, P. E. Jupp: Directional Statistics, Wiley 2000, section 2.3.
    """
    if min(len(one), len(other)) < 2:
        return False
    periods = [float(np.median(np.diff(each))) for each in (one, other)]
    if min(periods) <= 0.0 or abs(np.log(periods[0] / periods[1])) > ALIKE:
        return False
    inside = one[(one >= other[0]) & (one <= other[-1])]
    if len(inside) < FEWEST:
        return False
    phase = np.interp(inside, other, np.arange(len(other), dtype=float))
    return bool(np.abs(np.mean(np.exp(2j * np.pi * phase))) >= LOCKED)
