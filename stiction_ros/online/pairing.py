"""Brings PV and OP of one sample together, whatever order they come in and whatever lacks."""

import dataclasses
from collections import Counter, deque

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.online.input.sample_grid import keep

UNPAIRED = 5000  # samples of PV kept while their OP is missing
FAR = 100  # samples ahead: a stamp beyond is another clock, not a gap
SILENT = 20  # PVs without op_applied after which op counts again
NEW_RUN = 10  # rising stamps in succession, all too old or too far ahead, are a new run


@dataclasses.dataclass(frozen=True)
class PairedSample:
    """One sample."""

    sample: int  # number, counted from the first PV, on and on when a new run begins
    stamp: int  # ns
    op: FloatArray  # shape (m,)
    pv: FloatArray  # shape (p,); NaN where it never came
    begins: bool = False  # whether a new run begins with it


class Pairing:
    """Pairs by stamp; samples come out in order, each once.

    - A PV is paired with ``op_applied`` once one has been seen, else with ``op``; also when
      ``op_applied`` has not come for ``SILENT`` PVs. One whose OP
      never came (a later one did) takes the OP before it, which was held.
    - A stamp that was there already, that is older or more than ``FAR`` samples ahead is left
      out. ``NEW_RUN`` of these in succession that rise are a new run; a single one does nothing.
    - A sample whose PV never came has none, and its OP as given or held.

    Attributes:
        origin: stamp of sample 0 of the present run, ns; None before the first PV.
        counts: of samples that were ``missed`` or ``bad`` (not finite), and of PVs that were
            ``repeated``, ``stale`` or ``future``; of ``runs`` that began anew.
    """

    def __init__(self, sample_time: float) -> None:
        """Start empty; ``sample_time`` in seconds."""
        self._step = round(sample_time * 1e9)
        self._pv: dict[int, FloatArray] = {}
        # OPs by stamp, as sent and as applied
        self._given: dict[str, dict[int, FloatArray]] = {"op": {}, "op_applied": {}}
        self._past: deque[tuple[int, FloatArray]] = deque(maxlen=2 * FAR)  # used OPs, rising
        self._untold = SILENT + 1  # PVs since the last op_applied
        self._last: int | None = None
        self._strays: list[tuple[int, FloatArray]] = []
        self._begins = False
        self._next: int | None = None  # number of the next sample; None before the first
        self._earlier: list[tuple[int, int]] = []  # end (a sample) and origin of earlier runs
        self.origin: int | None = None
        self.counts: Counter[str] = Counter()

    @property
    def _op(self) -> dict[int, FloatArray]:
        """The OPs that are paired now, by stamp."""
        return self._given["op_applied" if self._untold <= SILENT else "op"]

    @property
    def behind(self) -> int:
        """How many PVs wait for their OP."""
        return len(self._pv)

    def stamp_of(self, sample: int) -> int:
        """Return the stamp of a sample, ns; there must have been a PV."""
        assert self.origin is not None
        found = (origin for end, origin in self._earlier if sample < end)
        return next(found, self.origin) + sample * self._step

    def add_pv(self, stamp: int, pv: FloatArray) -> list[PairedSample]:
        """Take in a PV and return the samples that are complete now."""
        if self.origin is None:
            self.origin = stamp
        if self._last is not None:
            if abs(stamp - self._last) <= self._step // 2:
                self.counts["repeated"] += 1
                return []
            if not 0 < stamp - self._last <= FAR * self._step:
                return self._stray(stamp, pv, self._last)
        self._strays.clear()
        self._accept(stamp, pv)
        self._untold += 1
        return self._complete()

    def add_op(self, stamp: int, op: FloatArray) -> list[PairedSample]:
        """Take in an OP that was sent and return the samples that are complete now."""
        keep(self._given["op"], stamp, op, UNPAIRED)
        return self._complete()

    def add_applied(self, stamp: int, op: FloatArray) -> list[PairedSample]:
        """Take in an OP that the valves were given and return the samples complete now."""
        self._untold = 0
        keep(self._given["op_applied"], stamp, op, UNPAIRED)
        return self._complete()

    # ---- stamps ----------------------------------------------------------------------------

    def _accept(self, stamp: int, pv: FloatArray) -> None:
        self._last = stamp
        keep(self._pv, stamp, pv, UNPAIRED)

    def _stray(self, stamp: int, pv: FloatArray, last: int) -> list[PairedSample]:
        """Leave out a stamp of the past or the far future, unless it makes up a new run."""
        self.counts["stale" if stamp < last else "future"] += 1
        if self._strays and stamp <= self._strays[-1][0]:
            self._strays.clear()
        self._strays.append((stamp, pv))
        return self._begin_anew() if len(self._strays) == NEW_RUN else []

    def _begin_anew(self) -> list[PairedSample]:
        """Take the stamps that were left out for those of a new run; sample numbers go on."""
        strays, number = self._strays, self._next or 0
        first, last = strays[0][0], strays[-1][0]
        if self.origin is not None:
            self._earlier.append((number, self.origin))
        self.origin = first - number * self._step
        self.counts["runs"] += 1
        self._begins, self._strays = True, []
        self._past.clear()
        self._pv.clear()
        early, late = first - 2 * self._step, last + FAR * self._step
        for given in self._given.values():
            for sent in [sent for sent in given if not early < sent < late]:
                del given[sent]
        for stamp, pv in strays:
            self._accept(stamp, pv)
        return self._complete()

    def _complete(self) -> list[PairedSample]:
        done: list[PairedSample] = []
        half = self._step // 2
        while self._pv and self._last is not None and self.origin is not None:
            stamp = next(iter(self._pv))
            own = [sent for sent in self._op if abs(sent - stamp) <= half]
            if not own and not any(stamp < sent <= self._last + half for sent in self._op):
                break  # its OP may still come
            pv = self._pv.pop(stamp)
            self._put_by(stamp + half)
            op = self._op_at(stamp)
            sample = (stamp - self.origin + half) // self._step
            first = sample if self._next is None or self._begins else self._next
            if op is None or sample < first:
                continue
            if sample - first > FAR:  # stamps of a new run need not follow each other closely
                first, self._begins = sample, True
            done += [self._lacking(number, op, pv) for number in range(first, sample)]
            done.append(PairedSample(sample, stamp, op, pv, self._begins))
            self.counts["missed"] += sample - first
            self.counts["bad"] += not np.isfinite(pv).all()
            self._next, self._begins = sample + 1, False
        return done

    def _lacking(self, sample: int, op: FloatArray, pv: FloatArray) -> PairedSample:
        """Return a sample whose PV never came; ``op`` and ``pv`` are the first behind it."""
        stamp = self.stamp_of(sample)
        given = self._op_at(stamp)
        return PairedSample(sample, stamp, op if given is None else given, np.full_like(pv, np.nan))

    def _put_by(self, end: int) -> None:
        """Move the OPs up to ``end`` to those that have been used; a stale one is forgotten."""
        for sent in sorted(sent for sent in self._op if sent <= end):
            op = self._op.pop(sent)
            if np.isfinite(op).all() and not (self._past and sent <= self._past[-1][0]):
                self._past.append((sent, op))

    def _op_at(self, stamp: int) -> FloatArray | None:
        """Return the OP in force at a stamp, the last one up to it."""
        end = stamp + self._step // 2
        return next((op for sent, op in reversed(self._past) if sent <= end), None)
