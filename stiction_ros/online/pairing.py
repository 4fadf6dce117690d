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
BRIDGED = 3  # samples in succession
BRIDGED_SHARE = 0.01  # of the window


@dataclasses.dataclass(frozen=True)
class PairedSample:
    """One sample."""

    sample: int  # number, counted from the first PV, on and on when a new run begins
    stamp: int  # ns
    op: FloatArray  # op, pv: shapes (m,) and (p,); PV is NaN at a bad sample that is not bridged
    pv: FloatArray
    missed: int = 0  # samples before it that never came and are not bridged
    bridged: bool = False  # whether PV is interpolated, as its own was missing or not finite
    begins: bool = False  # whether a new run begins with it


class Pairing:
    """Pairs by stamp; samples come out in order, each once.

    - A PV is paired with ``op_applied`` once one has been seen, else with ``op``; also when
      ``op_applied`` has not come for ``SILENT`` PVs. One whose OP
      never came (a later one did) takes the OP before it, which was held.
    - A stamp that was there already, that is older or more than ``FAR`` samples ahead is left
      out. ``NEW_RUN`` of these in succession that rise are a new run; a single one does nothing.
    - Up to ``longest`` samples in succession, and not more than 1 % of the window, whose PV is
      missing or not finite are bridged: PV linear between its neighbours, OP as given or held.
      More are left out: the window begins anew behind them.

    Attributes:
        origin: stamp of sample 0 of the present run, ns; None before the first PV.
        counts: of samples that were ``bridged``, ``missed`` or ``bad`` (not finite, not
            bridged), and of PVs that were ``repeated``, ``stale`` or ``future``; of ``runs``
            that began anew.
    """

    def __init__(self, sample_time: float, window: int = 0, longest: int = BRIDGED) -> None:
        """Start empty; ``sample_time`` in seconds, ``window`` in samples (0 bridges nothing)."""
        self._step = round(sample_time * 1e9)
        self._window, self._longest = window, longest
        self._pv: dict[int, FloatArray] = {}
        self._op: dict[int, FloatArray] = {}
        self._past: deque[tuple[int, FloatArray]] = deque(maxlen=2 * FAR)  # used OPs, rising
        self._applied = False
        self._sent: dict[int, FloatArray] = {}  # OPs that were sent while op_applied tells
        self._untold = 0  # PVs since the last op_applied
        self._last: int | None = None
        self._strays: list[tuple[int, FloatArray]] = []
        self._begins = False
        self._next = 0
        self._gap: list[PairedSample] = []
        self._good: PairedSample | None = None
        self._bridges: deque[int] = deque()
        self._earlier: list[tuple[int, int]] = []  # end (a sample) and origin of earlier runs
        self.origin: int | None = None
        self.counts: Counter[str] = Counter()

    def retune(self, window: int, longest: int) -> None:
        """Bridge as for this ``window`` from the next sample on."""
        self._window, self._longest = window, longest

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
        if self._applied and self._untold > SILENT:
            self._applied, self._op = False, {**self._op, **self._sent}
            self._sent = {}
        return self._complete()

    def add_op(self, stamp: int, op: FloatArray) -> list[PairedSample]:
        """Take in an OP that was sent and return the samples that are complete now."""
        if not self._applied:
            return self._take_op(stamp, op)
        keep(self._sent, stamp, op, 2 * SILENT)
        return []

    def add_applied(self, stamp: int, op: FloatArray) -> list[PairedSample]:
        """Take in an OP that the valves were given and return the samples complete now."""
        self._untold = 0
        if not self._applied:
            self._applied, self._sent = True, {}
            self._op = {sent: value for sent, value in self._op.items() if sent < stamp}
        return self._take_op(stamp, op)

    def _take_op(self, stamp: int, op: FloatArray) -> list[PairedSample]:
        keep(self._op, stamp, op, UNPAIRED)
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
        done, strays = self._close_gap(), self._strays
        first, last = strays[0][0], strays[-1][0]
        if self.origin is not None:
            self._earlier.append((self._next, self.origin))
        self.origin = first - self._next * self._step
        self.counts["runs"] += 1
        self._begins, self._good, self._strays = True, None, []
        self._past.clear()
        self._pv.clear()
        early, late = first - 2 * self._step, last + FAR * self._step
        self._op = {sent: value for sent, value in self._op.items() if early < sent < late}
        for stamp, pv in strays:
            self._accept(stamp, pv)
        return done + self._complete()

    def _complete(self) -> list[PairedSample]:
        done: list[PairedSample] = []
        half = self._step // 2
        while self._pv and self._last is not None and self.origin is not None:
            stamp = next(iter(self._pv))
            own = [sent for sent in self._op if abs(sent - stamp) <= half]
            if not own and not any(stamp < sent <= self._last + half for sent in self._op):
                break  # its OP may still come
            pv = self._pv.pop(stamp)
            known = any(np.isfinite(self._op[sent]).all() for sent in own) or not own
            self._put_by(stamp + half)
            op = self._op_at(stamp)
            sample = (stamp - self.origin + half) // self._step
            if op is not None and sample >= self._expected:
                done += self._bridge(PairedSample(sample, stamp, op, pv), known)
        return done

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

    # ---- bridges ---------------------------------------------------------------------------

    @property
    def _expected(self) -> int:
        return self._gap[-1].sample + 1 if self._gap else self._next

    def _bridge(self, found: PairedSample, known: bool) -> list[PairedSample]:
        """Return what is complete now that ``found`` is there; its OP may not be ``known``."""
        lacking = range(self._expected, found.sample)
        may = self._window and self._good is not None
        done: list[PairedSample] = []
        if may and len(lacking) + len(self._gap) <= self._longest:
            self._gap += [self._lacking(number, found) for number in lacking]
        elif lacking:
            done += self._close_gap()
            self.counts["missed"] += len(lacking)
            found = dataclasses.replace(found, missed=len(lacking))
        found = dataclasses.replace(found, begins=self._begins)
        self._begins = False
        if not (known and np.isfinite(found.pv).all()):
            self._gap.append(found)
            if self._good is None or len(self._gap) > self._longest or not self._window:
                done += self._close_gap()
            return done
        if self._gap and not self._room(found.sample):
            done += self._close_gap()
        for one in self._gap:
            self._bridges.append(one.sample)
            done.append(self._interpolated(one, found))
        self.counts["bridged"] += len(self._gap)
        self._gap, self._good, self._next = [], found, found.sample + 1
        return [*done, found]

    def _lacking(self, sample: int, after: PairedSample) -> PairedSample:
        """Return a sample whose PV never came, with its OP as far as that is known."""
        stamp = self.stamp_of(sample)
        op = self._op_at(stamp)
        nothing = np.full_like(after.pv, np.nan)
        return PairedSample(sample, stamp, after.op if op is None else op, nothing)

    def _close_gap(self) -> list[PairedSample]:
        """Give up what waits to be bridged: bad samples come out without a PV."""
        done = [dataclasses.replace(one, pv=np.full_like(one.pv, np.nan)) for one in self._gap]
        self.counts["bad"] += len(done)
        self._next, self._gap, self._good = self._expected, [], None
        return done

    def _room(self, sample: int) -> bool:
        """Return whether the window may hold the bridges of the present gap as well."""
        while self._bridges and self._bridges[0] <= sample - self._window:
            self._bridges.popleft()
        return len(self._bridges) + len(self._gap) <= BRIDGED_SHARE * self._window

    def _interpolated(self, one: PairedSample, after: PairedSample) -> PairedSample:
        assert self._good is not None
        share = (one.sample - self._good.sample) / (after.sample - self._good.sample)
        line = self._good.pv + share * (after.pv - self._good.pv)
        pv = np.where(np.isfinite(one.pv), one.pv, line)
        return dataclasses.replace(one, pv=pv, bridged=True)
