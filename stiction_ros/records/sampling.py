"""Is a record sampled regularly, and how often?"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError

SILENT = 1e-4  # jitter, as a share of the sample time, that is rounding and not worth a word
TOLERATED = 0.1  # jitter, as a share of the sample time, that is taken as regular with a note


def sample_time(
    time: FloatArray, where: str, place: Callable[[int], str]
) -> tuple[float, tuple[str, ...]]:
    """Return the seconds between two samples, and one note when the jitter is more than rounding.

    Args:
        time: times of the N samples in s, shape (N,).
        where: file or bag, for errors.
        place: names a sample for errors, ``place(3)`` → ``line 5``.

    Raises:
        InputError: fewer than two samples, time that does not increase, a gap.
    """
    if len(time) < 2:
        raise InputError(
            f"has {len(time)} sample{'s' * (len(time) != 1)}",
            where=where,
            fix="a record needs two at least",
        )
    steps = np.diff(time)
    if not (steps > 0).all():
        row = int(np.argmin(steps > 0)) + 1
        raise InputError(
            f"time does not increase at {place(row)} ({time[row - 1]:.9g}, then {time[row]:.9g} s)",
            where=where,
            fix="sort the rows and remove those that are there twice",
        )
    usual = float(np.median(steps))
    jitter = np.abs(steps - usual) / usual
    worst = int(np.argmax(jitter))
    if jitter[worst] > TOLERATED:
        row = int(np.argmax(jitter > TOLERATED)) + 1
        raise InputError(
            f"time is irregular at {place(row)}: {steps[row - 1]:.6g} s after the sample before, "
            f"elsewhere {usual:.6g} s",
            where=where,
            fix="cut the record there or resample it",
        )
    step = shortest(time[0], time[-1], len(steps), max(float(jitter[worst]), 1e-5))
    if jitter[worst] <= SILENT:
        return step, ()
    note = f"sample times jitter by up to {100 * jitter[worst]:.2g} %, taken as regular"
    return step, (note,)


def shortest(first: float, last: float, steps: int, tolerance: float) -> float:
    """Return the shortest decimal that is the step, s, of ``steps`` steps from one time to another.

    The last time may be moved by ``tolerance`` steps.
    """
    mean = float(last - first) / steps
    for digits in range(1, 15):
        short = float(f"{mean:.{digits}g}")
        if abs(short - mean) * steps <= tolerance * mean:
            return short
    return mean
