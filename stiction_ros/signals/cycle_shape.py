"""The shape of a movement: what a cycle of friction, a wave and noise make differently.

A valve that sticks makes OP go to and fro between two ends, in half cycles of nearly one length.
Noise through the controller makes half cycles of any length, and OP is mostly near the middle.
"""

from __future__ import annotations

import dataclasses
from typing import Self

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.movement import moving
from stiction_ros.signals.oscillation import oscillation

A_CYCLE = 24  # means of neighbouring samples: corners are kept, most noise is not
FEWEST = 4  # half cycles
UNSEEN_CYCLES = 10  # in a signal that does not oscillate: half cycles of its slow noise


@dataclasses.dataclass(frozen=True)
class CycleShape:
    """The shape of a signal's movement about its slow mean."""

    # standard deviation of the times between zero crossings over their mean, 0 for a regular cycle;
    # 1 where there are fewer than four
    half_cycles: float
    kurtosis: float  # 1 for a square, 1.5 for a sine, 1.8 for a triangle, 3 for noise

    @classmethod
    def of(cls, values: FloatArray) -> Self:
        """Return the shape of ``values``, shape (N,), a signal without gaps."""
        swing = oscillation(values, [(0, len(values))])
        period = len(values) / UNSEEN_CYCLES if swing is None else swing.period
        each = max(round(period / A_CYCLE), 1)
        whole = len(values) // each * each
        level = moving(values, period)[:whole].reshape(-1, each).mean(axis=1)
        level = level[np.isfinite(level)]
        if len(level) < 3 or not np.ptp(level) > 0.0:
            return cls(1.0, 3.0)
        crossed = np.diff(np.flatnonzero(np.diff(np.signbit(level))))
        half_cycles = crossed[crossed > 2]  # noise crosses to and fro
        uneven = half_cycles.std() / half_cycles.mean() if len(half_cycles) >= FEWEST else 1.0
        about = level - level.mean()
        kurtosis = np.mean(about**4) / np.mean(about**2) ** 2
        return cls(float(uneven), float(kurtosis))
