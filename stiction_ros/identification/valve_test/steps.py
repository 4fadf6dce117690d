"""The steps of OP in a record of a test in manual, and whether it is one."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray

SHORTEST = 7
"""Samples of a hold, at least: as many as process and noise have numbers, so that it shows more
than they can take up. Controllers that a historian samples faster than they scan hold OP, too."""

FEWEST = 5
"""Steps of a test, at least: more than the numbers of a PI law, which could explain fewer."""


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

    def refusal(self, error: FloatArray) -> str:
        """Return why this is no test in manual, one clause; empty where it is.

        Args:
            error: SP − PV, or −PV where SP is not known, engineering units, shape (N,).
        """
        inner = np.diff(self.rows)
        if len(self.rows) < FEWEST:
            return f"OP makes {len(self.rows)} steps, and a test {FEWEST} at least"
        if inner.min() < SHORTEST:
            return f"OP rests for {inner.min()} samples between two steps, and not {SHORTEST}"
        if self._answers(error):
            return "PV explains the moves of OP, as where a controller rounds its OP"
        return ""

    def _answers(self, error: FloatArray) -> bool:
        """Return whether a PI controller, its set-point free, is within its rounding of OP.

        Rounding to steps of q errs by q/√12, and q is at most the smallest move. A reset against
        the gain is none.
        """
        time = np.arange(self.count)
        away = error - error.mean()
        columns = np.column_stack([np.ones(self.count), time, away, np.cumsum(away)])
        op = np.repeat(self.levels, self.holds)
        law = np.linalg.lstsq(columns / np.abs(columns).max(axis=0).clip(1e-300), op)[0]
        if law[2] * law[3] < 0.0:
            columns = columns[:, [0, 2]]
        scaled = columns / np.abs(columns).max(axis=0).clip(1e-300)
        rest = op - scaled @ np.linalg.lstsq(scaled, op)[0]
        return bool(12.0 * rest.var() <= np.abs(np.diff(self.levels)).min() ** 2)
