"""What a loop is measured by: now, and under each thing that could be done about it.

- *Amplitude*: √2 × RMS of the spectral line of PV − SP at the period at which the loop cycles
  now, over pieces of four cycles, see :mod:`stiction_ros.identification.closed_loop.oscillation`.
- *IAE per hour*: ∫|PV − SP| dt per hour with time in hours, which is the mean |PV − SP|.
- *Travel*, *moves* and *reversals* of the stem, an hour: :mod:`stiction_ros.records.valve_work`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.oscillation import (
    LEAST_LINE,
    NEAR,
    REGULAR,
    Oscillation,
    amplitude,
    dominant_cycle,
    pieces,
)
from stiction_ros.records.valve_work import ValveWork


@dataclasses.dataclass(frozen=True)
class Measures:
    """How a loop does.

    Attributes:
        amplitude: engineering units of PV; None where the loop does not cycle now, so that there
            is no period to look at.
        iae_per_hour: engineering units of PV.
        travel_per_hour: of the stem, %.
        moves_per_hour: of the stem.
        reversals_per_hour: of the stem.
    """

    amplitude: float | None
    iae_per_hour: float
    travel_per_hour: float
    moves_per_hour: float
    reversals_per_hour: float

    def to_json(self) -> dict[str, float | None]:
        """Return the mapping of ``gain --json``."""
        return dataclasses.asdict(self)


@dataclasses.dataclass(frozen=True)
class Yardstick:
    """How the runs of one loop are measured, all alike.

    Attributes:
        sample_time: s.
        period: at which the loop cycles now, samples; None where it does not.
        stretches: without a move of the set-point, in samples of a run.
    """

    sample_time: float
    period: float | None
    stretches: Sequence[tuple[int, int]]

    def measure(self, error: FloatArray, stem: FloatArray, *, repeats: bool = False) -> Measures:
        """Return the measures of one run.

        Args:
            error: PV − SP, shape (n,), engineering units.
            stem: shape (n,), %.
            repeats: whether the run is to repeat the record: then the line is looked at where it
                is, as a cycle that goes a little faster than the recorded one is no smaller.
        """
        hours = len(error) * self.sample_time / 3600.0
        period = self._own(error) if repeats else self.period
        line = None
        if period is not None:
            line = amplitude(error, pieces(self.stretches, period), period)
        work = ValveWork.of(stem).per_hour(hours)
        return Measures(line, float(np.abs(error).mean()), work.travel, work.moves, work.reversals)

    def _own(self, error: FloatArray) -> float | None:
        """Return the period near the recorded one at which a run cycles, samples."""
        if self.period is None:
            return None
        near = self.period / NEAR, self.period * NEAR
        cycle = dominant_cycle(error[:, None], self.stretches, near)
        return self.period if cycle is None else cycle.period


def cycle_period(swing: Oscillation | None) -> float | None:
    """Return the period of a cycle, samples; None where nothing regular or clear stands out."""
    if swing is None or (swing.regularity <= REGULAR and swing.share < LEAST_LINE):
        return None
    return swing.period
