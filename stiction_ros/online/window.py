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
        self._op: deque[FloatArray] = deque(maxlen=longest)
        self._pv: deque[FloatArray] = deque(maxlen=longest)
        self._count = 0  # samples that were taken in
        self._lacking: deque[int] = deque()  # which of them are not finite

    def __len__(self) -> int:
        return len(self._op)

    def resize(self, longest: int) -> None:
        """Hold ``longest`` samples from now on."""
        self._op, self._pv = deque(self._op, longest), deque(self._pv, longest)

    def keep(self, count: int) -> None:
        """Drop all but the last ``count`` samples."""
        while len(self) > count:
            self._op.popleft(), self._pv.popleft()

    def add(self, op: FloatArray, pv: FloatArray) -> bool:
        """Take in a sample, OP (m,) and PV (p,); return whether the window holds it."""
        self._op.append(np.array(op, dtype=float))
        self._pv.append(np.array(pv, dtype=float))
        self._count += 1
        if np.isfinite(op).all() and np.isfinite(pv).all():
            return True
        self._lacking.append(self._count)
        while self._lacking[0] <= self._count - len(self):
            self._lacking.popleft()
        many = len(self._lacking)
        row = many > HELD and self._lacking[-1 - HELD] == self._count - HELD
        if row or many > SLIGHT * len(self):
            self.keep(0)
        return len(self) > 0

    def record(self, end: int) -> Record:
        """Return the samples up to the number ``end`` of the last one."""
        op = np.array(self._op).reshape(-1, len(self._valves))
        pv = np.array(self._pv).reshape(-1, len(self._outputs))
        if self._lacking:
            op = np.column_stack([carried(column, between=False) for column in op.T])
            pv = np.column_stack([carried(column, between=True) for column in pv.T])
        start = (end + 1 - len(self)) * self._sample_time
        return Record(
            self._loop, self._sample_time, self._valves, self._outputs, op, pv, start=start
        )
