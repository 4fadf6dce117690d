"""The last samples of a running loop, and the record that they make."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records import Record
from stiction_ros.records.regular import HELD, SLIGHT
from stiction_ros.records.whole import carried


class Window:
    """The last samples of a loop.

    A PV that lacks is interpolated, as in files and bags: up to :data:`HELD` in a row, and up to
    the share :data:`SLIGHT` of all. With one more the window begins anew behind it.
    """

    def __init__(
        self,
        loop: str,
        valves: Sequence[str],
        outputs: Sequence[str],
        sample_time: float,
        longest: int,
    ) -> None:
        """Start empty; ``sample_time`` in s, ``longest`` in samples."""
        self._loop, self._sample_time = loop, sample_time
        self._valves, self._outputs = tuple(valves), tuple(outputs)
        # OP and PV of each, and whether either lacks
        self._rows: deque[tuple[FloatArray, FloatArray, bool]] = deque(maxlen=longest)

    def __len__(self) -> int:
        return len(self._rows)

    def resize(self, longest: int) -> None:
        """Hold ``longest`` samples from now on."""
        self._rows = deque(self._rows, longest)

    def keep(self, count: int) -> None:
        """Drop all but the last ``count`` samples."""
        while len(self) > count:
            self._rows.popleft()

    def add(self, op: FloatArray, pv: FloatArray) -> bool:
        """Take in a sample, OP (m,) and PV (p,); return whether the window holds it."""
        lacks = not (np.isfinite(op).all() and np.isfinite(pv).all())
        self._rows.append((np.array(op, dtype=float), np.array(pv, dtype=float), lacks))
        if lacks:
            lacking = [row[2] for row in self._rows]
            if sum(lacking) > SLIGHT * len(self) or sum(lacking[-1 - HELD :]) > HELD:
                self.keep(0)
        return len(self) > 0

    def record(self, end: int) -> Record:
        """Return the samples up to the number ``end`` of the last one."""
        op = np.array([row[0] for row in self._rows]).reshape(-1, len(self._valves))
        pv = np.array([row[1] for row in self._rows]).reshape(-1, len(self._outputs))
        if any(row[2] for row in self._rows):
            op = np.column_stack([carried(column, between=False) for column in op.T])
            pv = np.column_stack([carried(column, between=True) for column in pv.T])
        start = (end + 1 - len(self)) * self._sample_time
        return Record(
            self._loop, self._sample_time, self._valves, self._outputs, op, pv, start=start
        )
