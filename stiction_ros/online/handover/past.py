"""What a running loop remembers: the last samples, in arrays of a fixed size."""

import numpy as np

from stiction_ros.control import History
from stiction_ros.effects.behaviour import FloatArray


class Past:
    """The last ``limit`` samples: OP as it was applied, PV, measured disturbances.

    Attributes:
        count: samples added so far, those that are forgotten included.
    """

    def __init__(self, limit: int, valves: int, outputs: int, disturbances: int) -> None:
        """Start empty."""
        self.limit, self.count = limit, 0
        self._op, self._pv, self._dv = (
            np.zeros((2 * limit, width)) for width in (valves, outputs, disturbances)
        )
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    def add(self, op: FloatArray, pv: FloatArray, dv: FloatArray) -> None:
        """Add one sample: OP (m,), PV (p,), which is NaN where it is missing, and DV (d,)."""
        if self._end == len(self._op):
            for rows in (self._op, self._pv, self._dv):
                rows[: self.limit] = rows[self.limit :]
            self._first, self._end = self._first - self.limit, self.limit
        for rows, values in ((self._op, op), (self._pv, pv), (self._dv, dv)):
            rows[self._end] = values
        self._end += 1
        self._first = max(self._first, self._end - self.limit)
        self.count += 1

    def clear(self) -> None:
        """Forget every sample; the count goes on."""
        self._first = self._end = 0

    def history(self) -> History:
        """Return a copy of all that is remembered."""
        return self._rows(self._first)

    def since(self, count: int) -> History:
        """Return a copy of the samples added after the first ``count`` of all."""
        return self._rows(max(self._end - (self.count - count), self._first))

    def _rows(self, first: int) -> History:
        rows = slice(first, self._end)
        return History(self._op[rows].copy(), self._pv[rows].copy(), self._dv[rows].copy())
