"""One record made ready: the rows that every friction, noise and delay is judged on."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects import FrictionLaw
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.friction_grid import find_law, simulate
from stiction_ros.records.record import Record

TAPS = 60  # of an impulse response, at most
SHARE = 8  # rows per tap, at least
LEFT_OUT = 0.05  # share of the rows at the begin, where a stem may not have found its place
NOISE_ORDER = 6


@dataclasses.dataclass(frozen=True)
class Problem:
    """Signals in their own scale, so that no unit of OP, PV or time changes an answer.

    Attributes:
        op: about its mean, %, shape (m, N).
        pv: means of ``rate`` samples, about their mean over their standard deviation, (p, n).
        rate: samples of OP per row.
        law: friction law.
        limit: largest f_S per valve, %, shape (m,).
        scale: standard deviation of OP per valve, %, shape (m,).
        skipped: smallest delay, rows.
    """

    op: FloatArray
    pv: FloatArray
    rate: int
    law: type[FrictionLaw]
    limit: FloatArray
    scale: FloatArray
    skipped: int = 0

    @classmethod
    def of(cls, record: Record, law: str = "he", rate: int = 1, skipped: int = 0) -> Problem:
        """Prepare a whole record.

        Args:
            record: without gaps.
            law: name of a friction law.
            rate: samples that are averaged to a row.
            skipped: smallest delay t_d, samples.

        Raises:
            InputError: an unknown law.
        """
        rows = len(record) // rate
        op, pv = record.op[: rows * rate].T, record.pv[: rows * rate].T
        centred = np.ascontiguousarray(op - op.mean(axis=1, keepdims=True))
        slow = pv.reshape(len(pv), rows, rate).mean(axis=2)
        return cls(
            op=centred,
            pv=(slow - slow.mean(axis=1, keepdims=True)) / slow.std(axis=1, keepdims=True),
            rate=rate,
            law=find_law(law),
            limit=np.ptp(op, axis=1),
            scale=centred.std(axis=1),
            skipped=skipped // rate,
        )

    @property
    def rows(self) -> int:
        """Number of rows of the record."""
        return int(self.pv.shape[1])

    @property
    def first(self) -> int:
        """First row that counts."""
        return max(round(LEFT_OUT * self.rows), NOISE_ORDER + 2)

    @property
    def count(self) -> int:
        """Rows that count."""
        return self.rows - self.first

    @property
    def taps(self) -> int:
        """M, length of an impulse response."""
        return max(min(TAPS, self.rows // SHARE), 2)

    def ideal_stems(self) -> FloatArray:
        """Return the stems of valves without friction, scaled, shape (m, n)."""
        return np.asarray(self._slowed(self.op) / self.scale[:, None])

    def stems(self, valve: int, friction: FloatArray, starts: FloatArray | float) -> FloatArray:
        """Return stems of one valve, scaled, shape (G, n).

        Args:
            valve: index.
            friction: rows (f_S, f_D), %, shape (G, 2).
            starts: stem before the first sample minus the first OP, %, one or (G,).
        """
        op = self.op[valve]
        begin = op[0] + np.broadcast_to(np.asarray(starts, dtype=float), (len(friction),))
        stems = simulate(self.law, friction, op, begin)
        return np.asarray(self._slowed(stems.T) / self.scale[valve])

    def _slowed(self, signals: FloatArray) -> FloatArray:
        shape = (len(signals), self.rows, self.rate)
        slow = np.ascontiguousarray(signals).reshape(shape).mean(axis=2)
        delayed: FloatArray = np.empty_like(slow)
        delayed[:, self.skipped :] = slow[:, : slow.shape[1] - self.skipped]
        delayed[:, : self.skipped] = slow[:, :1]
        return delayed
