"""The steps of OP in a record of a test in manual, and whether it is one."""

import dataclasses
import math

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray

SHORTEST = 7
"""Samples of a hold, at least: as many as process and noise have numbers, so that it shows more
than they can take up. Controllers that a historian samples faster than they scan hold OP, too."""

FEWEST = 5
"""Steps of a test, at least: more than the numbers of a PI law, which could explain fewer, as could
noise that lasts from one step to the next."""


@dataclasses.dataclass(frozen=True)
class Steps:
    """Steps of OP that rests between them."""

    rows: IntArray  # samples at which OP moved, (M,)
    levels: FloatArray  # OP before the first step and after each, (M + 1,), %
    count: int  # samples of the record

    @classmethod
    def of(cls, op: FloatArray) -> "Steps":
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
        """Return whether a PI controller, its set-point free, is within half a step of OP.

        OP that is rounded to steps of q is never farther than q/2 from the controller's own, and q
        is at most the smallest move. Where PV is rounded too, the sum of its errors comes on top. A
        reset against the gain is none.
        """
        from scipy.optimize import linprog

        away, one = error - error.mean(), np.ones(self.count)
        columns = np.column_stack([one, np.arange(self.count), away, np.cumsum(away), -one])
        scales = np.abs(columns).max(axis=0).clip(1e-300)
        columns /= scales
        rows = np.vstack([columns, columns * (-1.0, -1.0, -1.0, -1.0, 1.0)])
        op = np.repeat(self.levels - self.levels[0], self.holds)
        half = 0.5 * float(np.abs(np.diff(self.levels)).min())
        rounding = float(np.diff(np.unique(error)).min(initial=np.ptp(error)))
        for gain in ((0.0, None), (None, 0.0)):
            bounds = [(None, None), (None, None), gain, gain, (0.0, None)]
            law = linprog([0.0, 0.0, 0.0, 0.0, 1.0], rows, np.append(op, -op), bounds=bounds).x
            if law is not None:
                own = abs(law[3]) / scales[3] * rounding * math.sqrt(self.count / 12.0)
                if law[4] <= half * (1.0 + 1e-6) + own:
                    return True
        return False
