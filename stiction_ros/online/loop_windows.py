"""Windows of many loops in one place, filled sample by sample without a node for each."""

from collections import Counter, deque
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.online.pairing import PairedSample, Pairing
from stiction_ros.records import Record
from stiction_ros.records.quality import Quality


class LoopWindow:
    """The last samples of one loop, paired as the estimator pairs them.

    Attributes:
        samples: taken in, bad ones included.
        missed: that never came.
    """

    def __init__(self, name: str, sample_time: float, window: int) -> None:
        """Start empty; ``sample_time`` in s, ``window`` in samples."""
        self.name, self.sample_time = name, sample_time
        self._pairs = Pairing(sample_time)
        self._window: deque[PairedSample] = deque(maxlen=window)
        self._valves: tuple[str, ...] = ()
        self._outputs: tuple[str, ...] = ()
        self.samples = self.missed = 0

    def add_pv(self, stamp: int, outputs: Sequence[str], pv: FloatArray) -> None:
        """Take in a PV, stamp in ns."""
        self._outputs = self._outputs or tuple(outputs)
        if tuple(outputs) == self._outputs:
            self._keep(self._pairs.add_pv(stamp, pv))

    def add_applied(self, stamp: int, valves: Sequence[str], op: FloatArray) -> None:
        """Take in an OP that was in force, stamp in ns."""
        self._valves = self._valves or tuple(valves)
        if tuple(valves) == self._valves:
            self._keep(self._pairs.add_applied(stamp, op))

    @property
    def counts(self) -> Counter[str]:
        """What became of stamps, as :class:`Pairing` counts it."""
        return self._pairs.counts

    def __len__(self) -> int:
        return len(self._window)

    def record(self) -> Record | None:
        """Return the samples behind the last gap as a record; None for fewer than two."""
        rows = list(self._window)
        for i in range(len(rows) - 1, 0, -1):
            if rows[i].begins or rows[i].sample != rows[i - 1].sample + 1:
                rows = rows[i:]
                break
        if len(rows) < 2:
            return None
        pv = np.array([row.pv for row in rows])
        bad = ~np.isfinite(pv).all(axis=1)
        mask = np.where(bad, Quality.BAD, Quality.GOOD).astype(np.uint8)
        op = np.array([row.op for row in rows])
        return Record(
            self.name,
            self.sample_time,
            self._valves,
            self._outputs,
            op,
            pv,
            start=rows[0].stamp / 1e9,
            mask=mask,
        )

    def _keep(self, found: Sequence[PairedSample]) -> None:
        for one in found:
            self.samples += 1
            self.missed += one.missed
            self._window.append(one)
