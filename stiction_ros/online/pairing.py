"""Brings PV and OP of one sample together, whatever order they come in."""

from __future__ import annotations

import dataclasses

from stiction_ros.effects.behaviour import FloatArray

UNPAIRED = 5000  # samples of PV kept while their OP is missing


@dataclasses.dataclass(frozen=True)
class PairedSample:
    """One sample.

    Attributes:
        sample: number, counted from the first PV.
        stamp: ns.
        op, pv: shapes (m,) and (p,).
        missed: samples before it that never came.
    """

    sample: int
    stamp: int
    op: FloatArray
    pv: FloatArray
    missed: int


class Pairing:
    """Pairs by stamp; samples come out in order, each once.

    A PV whose OP never came (a later one did) takes the OP before it, which was held.
    """

    def __init__(self, sample_time: float) -> None:
        """Start empty; ``sample_time`` in seconds."""
        self._step = round(sample_time * 1e9)
        self._pv: dict[int, FloatArray] = {}
        self._op: dict[int, FloatArray] = {}
        self._held: FloatArray | None = None
        self._next = 0
        self.origin: int | None = None

    def stamp_of(self, sample: int) -> int:
        """Return the stamp of a sample, ns; there must have been a PV."""
        assert self.origin is not None
        return self.origin + sample * self._step

    def add_pv(self, stamp: int, pv: FloatArray) -> list[PairedSample]:
        """Take in a PV and return the samples that are complete now."""
        if self.origin is None:
            self.origin = stamp
        self._pv[stamp] = pv
        if len(self._pv) > UNPAIRED:
            del self._pv[min(self._pv)]
        return self._complete()

    def add_op(self, stamp: int, op: FloatArray) -> list[PairedSample]:
        """Take in an OP and return the samples that are complete now."""
        self._op[stamp] = op
        return self._complete()

    def _complete(self) -> list[PairedSample]:
        done = []
        while self._pv and self._op:
            stamp, oldest = min(self._pv), min(self._op)
            if oldest < stamp:
                self._held = self._op.pop(oldest)
                continue
            pv = self._pv.pop(stamp)
            self._held = self._op.pop(stamp, self._held)
            if self._held is None or self.origin is None:
                continue
            sample = (stamp - self.origin + self._step // 2) // self._step
            if sample >= self._next:
                done.append(PairedSample(sample, stamp, self._held, pv, sample - self._next))
                self._next = sample + 1
        return done
