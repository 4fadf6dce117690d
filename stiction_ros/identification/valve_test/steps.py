"""The steps of OP in a record of a test in manual, and whether it is one."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray

SHORTEST = 7
"""Samples of a hold, at least: as many as process and noise have numbers, so that it shows more
than they can take up. Controllers that a historian samples faster than they scan hold OP, too."""


@dataclasses.dataclass(frozen=True)
class Steps:
    """Steps of OP that rests between them.

    Attributes:
        rows: samples at which OP moved, (M,).
        levels: OP before the first step and after each, (M + 1,), %.
        count: samples of the record.
    """

    rows: IntArray
    levels: FloatArray
    count: int

    @classmethod
    def of(cls, op: FloatArray) -> Steps:
        """Return the steps of OP, shape (N,)."""
        rows = np.flatnonzero(np.diff(op) != 0.0) + 1
        return cls(rows, np.append(op[:1], op[rows]), len(op))

    @property
    def holds(self) -> IntArray:
        """Samples for which each level was held, the first included, shape (M + 1,)."""
        return np.diff(np.concatenate([[0], self.rows, [self.count]]))

    @property
    def reach(self) -> float:
        """How far OP went from its start, %."""
        return float(np.abs(self.levels - self.levels[0]).max())

    def refusal(self) -> str:
        """Return why this is no test in manual, one clause; empty where it is.

        OP that answers PV moves when PV brings news: at every scan or, where it is rounded, after
        times that differ by more than half, and without rounding to a level where it never was. OP
        that is moved by hand rests for times of one kind and comes back.
        """
        inner = np.diff(self.rows)
        if len(inner) == 0:
            return f"OP makes {len(self.rows)} steps, and a test two at least"
        if inner.min() < SHORTEST:
            return f"OP rests for {inner.min()} samples between two steps, and not {SHORTEST}"
        if inner.min() < 0.5 * np.median(inner):
            return "OP rests for times that differ as if it answered PV"
        if len(inner) > 1 and len(np.unique(self.levels)) == len(self.levels):
            return "OP never comes back to where it was"
        return ""
