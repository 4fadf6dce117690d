"""What reaches a controller, sorted into samples by written rules."""

import dataclasses
import math
from collections import Counter
from collections.abc import Mapping

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.online.input.op_port import AppliedOp, Given
from stiction_ros.online.input.sample_grid import Pace, SampleGrid, Succession, keep
from stiction_ros.online.input.samples import PortRules, Sample, SetPointPreview
from stiction_ros.online.input.signal_check import SignalCheck

SECOND = 1e9
LATEST = 2_140_000_000 * 10**9  # ns: stamps end in 2038, and those that follow must fit
PATIENCE = 3  # samples of PV that wait for the OP in force before a run begins without
SLACK = 3  # samples that a stamp may be further than the receiver's clock allows
LATENESS = 0.1  # s that a PV is waited for at least
AWAKE = 1.0  # s in which a receiver that stood still may get the rest of what came
LONGEST_GAP = 200  # samples; after a longer one a run begins anew
KEPT = 5000  # messages of each kind that wait for the others of their sample


class InputPort:
    """Takes in messages as they come and gives samples to work through, oldest first.

    In realtime the newest sample is answered and older ones are passed over; in lockstep every
    sample is answered in its turn. Nothing that arrives can stop what comes after it.

    Attributes:
        grid, pace: stamps and numbers of the samples; how long a sample takes.
        counts: everything that was refused, late or missing, by reason.
        behind: samples that had to be passed over for the newest at the last look.
        waiting: PVs that came while no run could begin.
    """

    def __init__(self, rules: PortRules) -> None:
        """Start before a run; times are seconds that only rise, given with every call."""
        self.rules = rules
        self.preview: SetPointPreview | None = None
        self.counts: Counter[str] = Counter()
        self._check = SignalCheck(rules.instruments)
        self.grid = SampleGrid(rules.step)
        self.pace = Pace(rules.period)
        self._refused = Succession(standing=rules.lockstep)
        self._applied = AppliedOp(rules.step)
        self._queue: dict[int, FloatArray] = {}  # PVs by stamp; of several the last one counts
        self._sp_at: dict[int, FloatArray] = {}
        self._dv_at: dict[int, FloatArray | None] = {}
        self._sp: FloatArray | None = None
        self._dv: FloatArray | None = None
        self._missed: dict[int, bool] = {}  # numbers of samples whose PV may still come
        self._seen: dict[str, float] = {}
        self._begun = False
        self.waiting = self.behind = 0
        self._pv_number, self._pv_now, self._blind_from = -1, 0.0, 0.0
        self._taken_at, self._in_time = 0.0, True
        self._looked: float | None = None
        self._awake, self._before = -math.inf, (-1, 0.0)  # the last PV before it slept

    # ---- what comes in ---------------------------------------------------------------------

    def add_pv(self, now: float, stamp: int, pv: FloatArray | None) -> None:
        """Take in a measurement (p,), NaN for a tag that lacks; None: it has no tag of ours."""
        if pv is None:
            self.counts["wrong tags"] += 1
            return
        if not 0 <= stamp <= LATEST:
            self.counts["ahead" if stamp > 0 else "stale"] += 1
            return
        self._seen["pv"] = now
        if len(self._queue) == KEPT and stamp not in self._queue:
            self.counts["overflow"] += 1
        keep(self._queue, stamp, pv, KEPT)

    def add_sp(self, now: float, stamp: int, sp: FloatArray | None) -> None:
        """Take in set-points (p,); None: not every tag is there."""
        good = sp is not None and self._check.within(sp)
        if good:
            self._sp, self._seen["sp"] = sp, now
        else:
            self.counts["wrong tags" if sp is None else "refused sp"] += 1
        if self.rules.lockstep and self.rules.scheduled and self._sp is not None:
            keep(self._sp_at, stamp, self._sp, KEPT)

    def add_dv(self, now: float, stamp: int, dv: FloatArray | None) -> None:
        """Take in measured disturbances (d,); None: not every tag is there."""
        if dv is not None and np.isfinite(dv).all():
            self._dv, self._seen["dv"] = dv, now
        else:
            self.counts["wrong tags" if dv is None else "refused dv"] += 1
        if self.rules.lockstep:
            keep(self._dv_at, stamp, self._dv, KEPT)

    def add_applied(self, now: float, stamp: int, op: FloatArray | None, ours: bool = True) -> None:
        """Take in the OP (m,) that the valves are given at ``stamp``, and whether it is ours."""
        if op is None or not np.isfinite(op).all():
            self.counts["wrong tags" if op is None else "refused op_applied"] += 1
            return
        self._seen["op_applied"] = now
        self._applied.add(stamp, op, ours)

    def add_preview(self, preview: SetPointPreview | None) -> None:
        """Take in set-points to come; None: it does not fit the outputs."""
        if preview is None or not self._check.within(preview.values):
            self.counts["refused sp_preview"] += 1
            return
        self.preview = preview

    # ---- what goes out ---------------------------------------------------------------------

    def ready(self) -> bool:
        """Return whether :meth:`take` may give something."""
        return bool(self._queue) and (not self.rules.lockstep or self._head() is not None)

    def take(self, now: float) -> tuple[Sample, ...]:
        """Return the samples to work through now, in their order; the last one is answered."""
        if self.rules.lockstep:
            return self._take_one(now)
        arrived, self._queue = self._queue, {}
        if not arrived:
            return ()
        last = next(reversed(arrived))
        self._look_at(now)
        self.pace.show(now, last, self.rules.step)
        if self._begun:
            samples = self._take_newest(now, arrived)
            if self._begun:
                return samples
        self.waiting += len(arrived)
        return self._begin(now, last, arrived[last])

    def overdue(self, now: float) -> tuple[Sample, ...]:
        """Return samples whose PV should have come by ``now``; ask several times a sample."""
        if self.rules.lockstep or not self._begun:
            return ()
        period = self.pace.period
        self._look_at(now)
        self._looked = now
        since = now - self._blind_from
        if since < period + max(period, LATENESS) or now - self._awake < LATENESS:
            return ()
        # A PV that comes again within a period of its time is not late yet.
        lacking = math.floor(since / period) - 1 - (self.grid.number - self._pv_number)
        if lacking <= 0:
            return ()
        skipped = max(lacking - LONGEST_GAP, 0)
        self._blind_from += skipped * period
        self.counts["blind"] += lacking - skipped
        samples = [self._missing(k == lacking - 1) for k in range(skipped, lacking)]
        self._in_time, self._taken_at = False, now
        return tuple(samples)

    def sent(self, now: float) -> None:
        """Note that the OP of the sample answered last has gone out."""
        if not self.rules.lockstep and now - self._taken_at > self.pace.period:
            self._in_time = False
            self.counts["late op"] += 1

    def rest(self) -> None:
        """Forget what is queued: after a pause a run begins with the next PV.

        In lockstep the plant has waited, so that a PV that follows on the last one continues.
        """
        self._queue.clear()
        self._refused.clear()
        self._looked = None
        if not self.rules.lockstep:
            self._begun, self.waiting = False, 0

    @property
    def next(self) -> int:
        """The number of the next sample."""
        return self.grid.number + 1

    def due(self, stamp: int) -> int:
        """Return the number of the sample at a stamp, or of the next one if that is over."""
        grid = self.grid
        return self.next if self.next == 0 else max(self.next, grid.number + grid.ahead(stamp))

    def ages(self, now: float) -> dict[str, float]:
        """Return s since the last good message of each topic; what never came is left out."""
        return {topic: now - seen for topic, seen in self._seen.items()}

    @property
    def period(self) -> float:
        """A sample, s by the receiver's clock; 0 in lockstep."""
        return 0.0 if self.rules.lockstep else self.pace.period

    @property
    def lacks(self) -> str:
        """What a run lacks to begin: ``sp``, ``op_applied`` or nothing."""
        if self._begun:
            return ""
        return "sp" if self._sp is None else "op_applied"

    # ---- lockstep --------------------------------------------------------------------------

    def _head(self) -> int | None:
        """Return the oldest sample that has all it needs; incomplete ones before it are lost."""
        if self._begun:
            self._refuse_what_does_not_fit()
        head = min(filter(self._complete, self._queue), default=None)
        if head is not None:
            self._queue = {stamp: pv for stamp, pv in self._queue.items() if stamp >= head}
        return head

    def _refuse_what_does_not_fit(self) -> None:
        """Refuse old stamps; far ones too, unless the samples before them are there."""
        newer = {stamp: self.grid.ahead(stamp) for stamp in self._queue}
        far = min((n for n in newer.values() if n > 0), default=0) > SLACK
        for stamp, ahead in newer.items():
            if self._begun and (far or ahead <= 0):
                self.counts["ahead" if ahead > 0 else "stale"] += 1
                if self._refused.add(stamp, True):
                    self._end_run()
                else:
                    del self._queue[stamp]

    def _complete(self, stamp: int) -> bool:
        if self._sp is None or (self.rules.scheduled and stamp not in self._sp_at):
            return False
        return not self.rules.needs_dv or stamp in self._dv_at

    def _take_one(self, now: float) -> tuple[Sample, ...]:
        stamp = self._head()
        if stamp is None:
            return ()
        pv = self._queue.pop(stamp)
        if not self._begun:
            samples = self._begin(now, stamp, pv)
        else:
            self._refused.clear()
            samples = self._follow(now, {self.grid.ahead(stamp): (stamp, pv)})
        for waiting in (self._sp_at, self._dv_at):
            for old in [at for at in waiting if at <= stamp]:
                del waiting[old]
        return samples

    # ---- realtime --------------------------------------------------------------------------

    def _look_at(self, now: float) -> None:
        """Note when the receiver itself stood still: what came is only now on its way."""
        patience = max(self.pace.period, LATENESS)
        if self._looked is not None and now - self._looked > patience:
            self._looked = self._awake = now
            self._before = self._pv_number, self._pv_now

    def _take_newest(self, now: float, arrived: Mapping[int, FloatArray]) -> tuple[Sample, ...]:
        """Return the samples up to the newest that fits; not ``_begun`` after a new run."""
        number, heard = self._pv_number, self._pv_now
        if now - self._awake < AWAKE:
            number, heard = self._before
        since = max(now - heard, 0.0) / self.pace.period
        latest = number - self.grid.number + SLACK + 2.0 * since
        fitting: dict[int, tuple[int, FloatArray]] = {}
        for stamp, pv in sorted(arrived.items(), key=lambda one: one[0]):
            ahead = self.grid.ahead(stamp)
            if ahead > max(latest, max(fitting, default=0) + SLACK):
                self.counts["ahead"] += 1
            elif ahead > 0:
                fitting.setdefault(ahead, (stamp, pv))
            else:
                late = self._missed.pop(self.grid.number + ahead, False)
                self.counts["late" if late else "stale"] += 1
        if not fitting:
            for stamp in arrived:
                follows = self._refused.last is None or (
                    stamp - self._refused.last <= (SLACK + 2.0 * since) * self.rules.step
                )
                if self._refused.add(stamp, follows or stamp < self.grid.stamp):
                    self._end_run()
                    break
            return ()
        self._refused.clear()
        return self._follow(now, fitting)

    # ---- both ------------------------------------------------------------------------------

    def _end_run(self) -> None:
        """Let a run begin with the next sample; enough of them have been waited for already."""
        self.counts["new runs"] += 1
        self._refused.clear()
        self._begun, self.waiting = False, PATIENCE

    def _begin(self, now: float, stamp: int, pv: FloatArray) -> tuple[Sample, ...]:
        """Begin a run with a PV if the OP in force is known or was waited for."""
        in_force = self._applied.in_force(stamp)
        waits = in_force is None and not self.rules.lockstep and self.waiting < PATIENCE
        if self._sp is None or waits:
            return ()
        self._begun, self.waiting, self.behind = True, 0, 0
        self._refused.clear()
        self._check.forget()
        self.grid.begin(stamp)
        self._applied.before(stamp, True)
        self._heard(now)
        return (self._sample(pv, stamp, True, Given(in_force), begins=True),)

    def _follow(
        self, now: float, fitting: Mapping[int, tuple[int, FloatArray]]
    ) -> tuple[Sample, ...]:
        """Return every sample up to the newest of ``fitting``, by samples ahead of the last."""
        newest = max(fitting)
        missing = newest - len(fitting)
        if missing > LONGEST_GAP:
            self._end_run()
            return self._begin(now, *fitting[newest])
        self.counts["missing"] += missing
        self.counts["passed over"] += len(fitting) - 1
        self.behind = len(fitting) - 1
        samples = []
        for k in range(1, newest + 1):
            if k not in fitting:
                samples.append(self._missing(False))
                continue
            stamp, pv = fitting[k]
            self.grid.advance(stamp)
            samples.append(self._sample(pv, stamp, k == newest, self._given(stamp)))
        self._heard(now)
        return tuple(samples)

    def _missing(self, answered: bool) -> Sample:
        self.grid.advance(None)
        stamp = self.grid.stamp
        keep(self._missed, self.grid.number, True, KEPT)
        return self._sample(None, stamp, answered, self._given(stamp))

    def _given(self, stamp: int) -> Given:
        given = self._applied.before(stamp, self._in_time)
        return dataclasses.replace(given, known=True) if self.rules.lockstep else given

    def _heard(self, now: float) -> None:
        """Note when the newest PV came."""
        self._pv_number, self._pv_now = self.grid.number, now
        self._blind_from = self._taken_at = now

    def _sample(
        self, pv: FloatArray | None, stamp: int, answered: bool, given: Given, begins: bool = False
    ) -> Sample:
        seen = np.full(len(self.rules.instruments), np.nan)
        if pv is not None:
            self.counts["bad values"] += int(np.count_nonzero(~np.isfinite(pv)))
            seen = self._check.measured(stamp / SECOND, pv)
            self.counts["out of range"] += int(np.count_nonzero(np.isfinite(pv) & np.isnan(seen)))
        # An OP that stays in force while samples are passed over answers none of them.
        self._in_time = answered
        assert self._sp is not None
        sp, dv = self._sp, self._dv
        if self.rules.lockstep:
            sp, dv = self._sp_at.get(stamp, sp), self._dv_at.get(stamp)
        return Sample(self.grid.number, stamp, seen, sp, dv, answered, begins, given)
