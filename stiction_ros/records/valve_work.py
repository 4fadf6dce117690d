"""What a valve has to do: how far its stem goes, how often it moves, how often it turns."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.record import Quality, Record

STANDS = 1e-9  # share of the stem's range up to which a move is rounding


@dataclasses.dataclass(frozen=True)
class ValveWork:
    """The work of one valve over a stretch of time, or per hour.

    Examples:
        >>> import numpy as np
        >>> ValveWork.of(np.array([50.0, 58.0, 58.0, 50.0]))
        ValveWork(travel=16.0, moves=2.0, reversals=1.0)
    """

    travel: float  # Σ|Δχ|, %
    moves: float  # samples at which the stem moves
    reversals: float  # moves in the other direction than the one before

    @classmethod
    def of(cls, stem: FloatArray) -> "ValveWork":
        """Return the work of the stem positions ``stem``, shape (N,), %."""
        steps = np.diff(stem)
        steps = steps[np.abs(steps) > STANDS * float(np.ptp(stem))] if len(stem) else steps
        turns = np.count_nonzero(np.diff(np.signbit(steps)))
        return cls(float(np.abs(steps).sum()), float(len(steps)), float(turns))

    def per_hour(self, hours: float) -> "ValveWork":
        """Return the work of one hour, of what was done in ``hours``."""
        return ValveWork(self.travel / hours, self.moves / hours, self.reversals / hours)


def work_per_hour(record: Record) -> Mapping[str, ValveWork]:
    """Return the work of each valve of ``record`` by tag; empty where its stems are unknown.

    A sample that is missing is left out: what the stem did meanwhile counts as one move.
    """
    there = record.quality != Quality.BAD
    if record.stem is None or there.sum() < 2:
        return {}
    hours = len(record) * record.sample_time / 3600.0
    stems = record.stem[there].T
    return {
        name: ValveWork.of(stem).per_hour(hours)
        for name, stem in zip(record.valves, stems, strict=True)
    }


def largest_op_step(record: Record) -> Mapping[str, float]:
    """Return the largest move of each OP from one sample to the next, by valve, %."""
    op = record.op[record.quality != Quality.BAD]
    steps = np.abs(np.diff(op, axis=0)).max(axis=0, initial=0.0)
    return dict(zip(record.valves, steps.tolist(), strict=True))
