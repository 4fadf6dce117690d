"""Changes of tags, paired to the samples of a loop by one written rule."""

import dataclasses
import enum
import math
from collections import Counter, deque

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.opcua.tag_map import LoopTags

HEARD = 5  # PV stamps of which the freshest tells the plant's time
KEPT = 4096  # changes of one tag between two samples
JITTER = 10  # a part of a sample: scans of a control system are that regular
SETTLE = 2  # a part of a sample: so late may a change come
FAR = 3  # samples: a stamp that much ahead of the plant's time is another clock
UNREPORTED = 10  # samples after which a PV that was never reported is waited for no more
LOST = 100  # samples: no more of them are told again after the plant's clock has jumped
DOUBTED = 3  # refused stamps of a tag in succession: what it said before holds no more
SUCCESSION = 10  # refused stamps, or scans beside the grid, in succession are believed
SCAN = 0.75  # samples from one scan to the next at least
FOLLOWED = 8  # samples after which most of a shift of the scans is followed
LOCAL_OVERRIDE = 0x00960000  # OPC UA part 8: put in by hand, so it is no measurement


class TagQuality(enum.IntEnum):
    """How good a value is, the best first; the number stands in ``effort`` of ``pv``."""

    GOOD = 0
    UNCERTAIN = 1  # such as a last usable value, or one put in by hand
    BAD = 2
    SILENT = 3  # nothing is heard of the server, or nothing was ever heard of the tag


@dataclasses.dataclass(frozen=True, slots=True)
class TagReading:
    """One report of one tag."""

    value: float | str | None  # as it was sent; None when there was none
    quality: TagQuality  # of the value
    stamp: int  # source time stamp, ns
    first: bool = False  # whether it opens a subscription: the present value, maybe long past

    @property
    def number(self) -> float:
        """The value as a finite number, else NaN."""
        if isinstance(self.value, str) or self.value is None:
            return math.nan
        return float(self.value) if math.isfinite(self.value) else math.nan


NOTHING = TagReading(None, TagQuality.SILENT, 0)


def quality_of(status: int) -> TagQuality:
    """Return the quality that an OPC UA status code (32 bits) stands for."""
    severity = status >> 30
    if severity == 0:
        overridden = status & 0xFFFF0000 == LOCAL_OVERRIDE
        return TagQuality.UNCERTAIN if overridden else TagQuality.GOOD
    return TagQuality.UNCERTAIN if severity == 1 else TagQuality.BAD


@dataclasses.dataclass(frozen=True)
class PlantSample:
    """One sample of a loop."""

    stamp: int  # ns, by the plant's clock
    pv: FloatArray  # pv, sp, dv: shapes (p,), (p,), (d,); NaN where the quality is not good
    sp: FloatArray
    dv: FloatArray
    pv_age: FloatArray  # s of the plant's time since each PV changed, shape (p,)
    pv_quality: tuple[TagQuality, ...]  # of each PV
    op_before: FloatArray  # OP in force in the sample before, shape (m,), %; NaN where not known


class PlantClock:
    """The plant's time: the freshest of the last stamps, carried on by our own clock.

    The plant's clock need not agree with ours. What is heard late tells less than what is
    heard at once, so of the last ``HEARD`` stamps the one that is furthest ahead counts.
    """

    def __init__(self, speed: float) -> None:
        """Start without a stamp; ``speed`` in seconds of the plant per second of ours."""
        self._rate = speed * 1e9
        self._leads: deque[int] = deque(maxlen=HEARD)
        self._last = 0

    def hear(self, stamp: int, now: float) -> None:
        """Take in a source stamp, ns, heard at ``now``, s; tags of one scan count once."""
        lead = stamp - round(now * self._rate)
        if self._leads and stamp <= self._last:
            return
        self._last = stamp
        self._leads.append(lead)

    def now(self, now: float) -> int | None:
        """Return the plant's time, ns; None before the first stamp."""
        return max(self._leads) + round(now * self._rate) if self._leads else None


class LoopSampler:
    """Makes samples at every sample time of what tags report when they change.

    With t_k the time of sample k, T the sample time and a jitter of T/10:

    - PV, SP and DV of sample k are the last values with stamps up to t_k + jitter. It closes when
      each PV has a stamp within the jitter of t_k or later, and otherwise T/2 after t_k.
    - OP in force in sample k is the last with a stamp up to t_k + T/2; it is told with k + 1.
    - t_0 is the stamp of the first PV that changes, or else the newest stamp heard. The grid
      follows slow shifts of the PV's stamps, and moves when ten in succession lie beside it alike.
    - Stamps of the past and of the future are refused and counted. After three in succession the
      tag has no value; the tenth is believed, and begins a new run when it is that of a PV.
    - A value that is not good, or of a server that is silent, is NaN.

    Attributes:
        clock: the plant's time.
        counts: of readings that were ``past``, ``ahead``, ``late`` or ``bad``, samples that were
            ``skipped``, and ``new_runs``.
    """

    def __init__(self, tags: LoopTags, speed: float = 1.0) -> None:
        """Start before the first stamp; ``speed`` in seconds of the plant per second of ours."""
        self.tags = tags
        self.clock = PlantClock(speed)
        self._speed = speed
        self._changes: dict[str, deque[TagReading]] = {
            tag: deque(maxlen=KEPT) for tag in tags.read_tags()
        }
        self._pv = {output.pv for output in tags.outputs}
        self._jitter = tags.sample_ns // JITTER
        self._next: int | None = None
        self._closed: int | None = None  # stamp of the last sample
        self._heard_at: float | None = None
        self._strays: Counter[str] = Counter()  # in succession, by tag
        self._beside = 0
        self._phase = self._followed = 0
        self.counts: Counter[str] = Counter()

    def hear(self, tag: str, reading: TagReading, now: float) -> None:
        """Take in what was reported of a tag at ``now``, s on our clock."""
        if self._heard_at is None:
            self._heard_at = now
        changes = self._changes[tag]
        last = changes[-1] if changes else NOTHING
        if reading.first:
            reading = dataclasses.replace(reading, stamp=max(reading.stamp, last.stamp))
            del self._strays[tag]
        elif self._is_stray(tag, reading, last, now):
            return
        if reading.quality is not TagQuality.GOOD:
            self.counts["bad"] += 1
        changes.append(reading)
        if tag not in self._pv or reading.first:
            return
        self.clock.hear(reading.stamp, now)
        if self._next is None:
            self._next = reading.stamp
        elif self._closed is not None and reading.stamp <= self._closed + self._jitter:
            self.counts["late"] += 1
        self._follow(reading.stamp)

    def due(self, now: float, alive: bool) -> list[PlantSample]:
        """Return the samples that are closed by ``now``, s; ``alive``: the server is heard."""
        self._begin_without_change(now)
        present = self.clock.now(now)
        found: list[PlantSample] = []
        while self._next is not None and present is not None:
            ready = alive and all(
                self.latest(tag).stamp >= self._next - self._jitter for tag in self._pv
            )
            if not ready and present < self._next + self.tags.sample_ns // SETTLE:
                break
            if ready and present > self._next + LOST * self.tags.sample_ns:
                # A held value would tell of none of the samples that were lost.
                lost = (present - self._next) // self.tags.sample_ns
                self.counts["skipped"] += lost
                self._next += lost * self.tags.sample_ns
                continue
            found.append(self._close(self._next, alive))
            self._closed, self._next = self._next, self._next + self.tags.sample_ns
        return found

    def latest(self, tag: str) -> TagReading:
        """Return the newest report of a tag; one without a value where there is none."""
        return self._unless_doubted(tag, self._changes[tag][-1] if self._changes[tag] else NOTHING)

    def number(self, tag: str) -> float:
        """Return the newest value of a tag if it counts, else NaN."""
        return self._value(self.latest(tag), alive=True)

    # ---- stamps ----------------------------------------------------------------------------

    def _is_stray(self, tag: str, reading: TagReading, last: TagReading, now: float) -> bool:
        present = self.clock.now(now)
        past = reading.stamp < last.stamp
        ahead = present is not None and reading.stamp > present + FAR * self.tags.sample_ns
        if not past and not ahead:
            del self._strays[tag]
            return False
        self.counts["past" if past else "ahead"] += 1
        self._strays[tag] += 1
        if self._strays[tag] < SUCCESSION:
            return True
        del self._strays[tag]
        if tag in self._pv:
            self._begin_anew()
        self._changes[tag].clear()
        return False

    def _begin_anew(self) -> None:
        """Believe the stamps that were refused: the plant's clock was set."""
        for tag, changes in self._changes.items():
            kept = [dataclasses.replace(one, stamp=0) for one in list(changes)[-1:]]
            self._changes[tag] = deque(kept, maxlen=KEPT)
        self.clock = PlantClock(self._speed)
        self._next = self._closed = None
        self._strays.clear()
        self._followed = 0
        self.counts["new_runs"] += 1

    def _begin_without_change(self, now: float) -> None:
        """Begin at the newest stamp when no PV has changed for three samples."""
        if self._next is not None or self._heard_at is None:
            return
        patience = FAR if all(self._changes[tag] for tag in self._pv) else UNREPORTED
        if (now - self._heard_at) * self._speed < patience * self.tags.sample_time:
            return
        newest = max((c[-1].stamp for c in self._changes.values() if c), default=0)
        if newest:
            self.clock.hear(newest, now)
            self._next = newest

    def _follow(self, stamp: int) -> None:
        """Let the grid follow the scans of the plant; one stamp a sample tells of them."""
        assert self._next is not None
        step = self.tags.sample_ns
        if stamp < self._followed + SCAN * step:
            return
        self._followed = stamp
        beside = (stamp - self._next + step // 2) % step - step // 2
        if abs(beside) <= self._jitter:
            self._beside = 0
            self._next += int(beside / FOLLOWED)
            return
        alike = abs(beside - self._phase) <= self._jitter
        self._beside = self._beside + 1 if alike else 1
        self._phase = beside
        if self._beside >= SUCCESSION:
            self._next += beside
            self._beside = 0

    # ---- samples ---------------------------------------------------------------------------

    def _close(self, stamp: int, alive: bool) -> PlantSample:
        tags, cut = self.tags, stamp + self._jitter
        before = stamp - tags.sample_ns + tags.sample_ns // 2
        op = [self._value(self._at(valve.op_read, before), alive) for valve in tags.valves]
        pv = [self._at(output.pv, cut) for output in tags.outputs]
        sp = [self._at(output.sp, cut) if output.sp else NOTHING for output in tags.outputs]
        dv = [self._at(one.tag, cut) for one in tags.disturbances]
        ages = [(stamp - one.stamp) / 1e9 if one.stamp else np.nan for one in pv]
        return PlantSample(
            stamp,
            np.array([self._value(one, alive) for one in pv]),
            np.array([self._value(one, alive) for one in sp]),
            np.array(
                [
                    self._value(one, alive) - told.nominal
                    for one, told in zip(dv, tags.disturbances, strict=True)
                ]
            ),
            np.maximum(np.array(ages), 0.0),
            tuple(one.quality if alive else TagQuality.SILENT for one in pv),
            np.array(op),
        )

    def _at(self, tag: str, cut: int) -> TagReading:
        """Return the last report with a stamp up to ``cut`` and forget those before it."""
        changes = self._changes[tag]
        while len(changes) > 1 and changes[1].stamp <= cut:
            changes.popleft()
        found = changes[0] if changes and changes[0].stamp <= cut else NOTHING
        return self._unless_doubted(tag, found)

    def _unless_doubted(self, tag: str, reading: TagReading) -> TagReading:
        if self._strays[tag] < DOUBTED:
            return reading
        return dataclasses.replace(reading, quality=TagQuality.BAD)

    def _value(self, reading: TagReading, alive: bool) -> float:
        usable = reading.quality is TagQuality.GOOD or (
            self.tags.uncertain and reading.quality is TagQuality.UNCERTAIN
        )
        return reading.number if usable and alive else float("nan")
