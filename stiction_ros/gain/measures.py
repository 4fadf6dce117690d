"""What a loop is measured by: now, and under each thing that could be done about it.

- *Amplitude* and *period* of the dominant line of PV − SP, each run its own: see
  :mod:`stiction_ros.signals.oscillation`.
- *IAE per hour*: ∫|PV − SP| dt per hour with time in hours, which is the mean |PV − SP|.
- *Travel*, *moves* and *reversals* of the stem, an hour: :mod:`stiction_ros.records.valve_work`.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.valve_work import ValveWork
from stiction_ros.signals.oscillation import (
    LEAST_LINE,
    REGULAR,
    Oscillation,
    amplitude,
    oscillation,
    pieces,
)


@dataclasses.dataclass(frozen=True)
class Measures:
    """How a loop does."""

    amplitude: float | None  # engineering units of PV; None where the loop does not cycle now
    iae_per_hour: float  # engineering units of PV
    travel_per_hour: float  # of the stem, %
    moves_per_hour: float  # of the stem
    reversals_per_hour: float  # of the stem
    period: float | None = None  # at which the amplitude is, s; None where there is none


@dataclasses.dataclass(frozen=True)
class Yardstick:
    """How the runs of one loop are measured, all alike."""

    sample_time: float  # s
    cycles: bool  # whether the loop cycles now; else no run has an amplitude
    stretches: Sequence[tuple[int, int]]  # without a move of the set-point, in samples of a run

    def measured(self, error: FloatArray, stem: FloatArray) -> Measures | None:
        """Return the measures of one run, as :meth:`measure`; None where it grows without end."""
        return self.measure(error, stem) if np.isfinite(error).all() else None

    def measure(self, error: FloatArray, stem: FloatArray) -> Measures:
        """Return the measures of one run by PV − SP, engineering units, and stem, %, (n,) each."""
        hours = len(error) * self.sample_time / 3600.0
        line = 0.0 if self.cycles else None
        period = None
        if self.cycles and (swing := oscillation(error, self.stretches)) is not None:
            line = amplitude(error, pieces(self.stretches, swing.period), swing.period)
            period = swing.period * self.sample_time
        work = ValveWork.of(stem).per_hour(hours)
        iae = float(np.abs(error).mean())
        return Measures(line, iae, work.travel, work.moves, work.reversals, period)


def cycle_period(swing: Oscillation | None) -> float | None:
    """Return the period of a cycle, samples; None where nothing regular or clear stands out."""
    if swing is None or (swing.regularity <= REGULAR and swing.share < LEAST_LINE):
        return None
    return swing.period
