"""One loop between its tags and its topics: what goes out, what may be written, and why."""

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.online.health import stopped_after
from stiction_ros.online.input.op_port import OpPort, Reception
from stiction_ros.opcua.grant import GrantState, begin
from stiction_ros.opcua.op_limits import OpLimits, RateWatch
from stiction_ros.opcua.sampling import LoopSampler, PlantSample, TagQuality, TagReading
from stiction_ros.opcua.tag_map import GrantTags, LoopTags, Use

PATIENCE = 3  # samples of bad quality in succession before the plant takes over
BEATS = 5  # beats in the time of the watchdog
SLOW = 2  # a part of the watchdog's time: an answer may take that long
IN_TIME = 0.5  # s, or a sample where that is longer, in which an OP must be written
AGAIN = 1.0  # s between two attempts to take a request back
MODE_REFUSES = "the mode does not grant it"
IDENTITIES = 1 << 15  # numbers of writers
COUNT = 1 << 16  # beats until the count begins anew


def beat_of(identity: int, count: int) -> int:
    """Return a beat that bears its writer, so that another one is seen.

    It is ``identity`` · 65 536 + count, a whole number of 31 bits.
    """
    return identity * COUNT + count % COUNT


def identity_of(beat: float) -> int:
    """Return the number of the writer of a beat; 0 is nobody."""
    return int(beat) // COUNT if 0 <= beat < IDENTITIES * COUNT else -1


@dataclasses.dataclass
class HeardBeat:
    """Someone's beat, and when it changed last, s; minus infinity before."""

    _value: float | None = None
    changed_at: float = -np.inf

    def hear(self, value: float, now: float, first: bool) -> None:
        """Take in a beat at ``now``, s; the ``first`` report of a subscription is no change."""
        if value != self._value:
            self._value = value
            if not first:
                self.changed_at = now


@dataclasses.dataclass(frozen=True)
class WriteOrder:
    """What to write in one call of the service."""

    loop: str  # that it belongs to
    kind: Use  # of what
    values: tuple[tuple[str, float], ...]  # node and value each
    expires: float  # s on our clock after which it is not written any more
    modes: tuple[str, ...] = ()  # nodes that must say one of ``granted`` right before it is written
    granted: tuple[str, ...] = ()  # see ``modes``


@dataclasses.dataclass(frozen=True)
class BridgeRules:
    """How a loop is bridged."""

    speed: float = 1.0  # seconds of the plant per second of our clock
    writes: bool = False  # whether anything may be written at all
    asks: bool = False  # whether the grant is asked for at the start
    commander: str = ""  # node whose OP is taken, by full name; empty for the first to command
    identity: int = 1  # number that tells our heartbeat from others', 1 … 32 767


class LoopBridge:
    """Hands tags to a :class:`LoopSampler`, and OPs to the plant as long as it grants them.

    All times are s on one clock that only rises, handed in by the caller. The bridge itself
    writes nothing: it returns orders, and is told by :meth:`written` what became of each. What is
    against writing gives a grant back at once, as a write that is refused or takes too long does.
    """

    def __init__(self, tags: LoopTags, rules: BridgeRules, now: float) -> None:
        """Begin to listen; ``rules.writes`` needs ``tags.grant``."""
        self.tags, self.rules = tags, rules
        self.sampler = LoopSampler(tags, rules.speed)
        self.grant = begin(rules.writes and tags.grant is not None)
        if rules.asks:
            self.grant = self.grant.ask()
        self.op_port = OpPort(rules.commander, tags.sample_ns, exact=False)
        self.counts: Counter[str] = Counter()
        self.refused: tuple[str, ...] = ()
        valves = tags.valves
        names, rates = [v.name for v in valves], [v.rate for v in valves]
        self.rate_watch = RateWatch(names, rates, tags.sample_time)
        self._foreign, self._plant, self._beaten = HeardBeat(), HeardBeat(), 0
        self._alive = False
        self._alive_since = self._command_at = self._beat_at = now
        self._told = 0.0  # what the request says, as far as we wrote it
        self._tried: tuple[float, float] | None = None  # a request that is under way, and when
        self._bad = 0  # samples of bad quality in succession
        self._stamp: int | None = None
        self._writing: WriteOrder | None = None  # an OP that is under way
        self._last: tuple[FloatArray, float] | None = None  # OP written in this grant, and when
        self._read_at: dict[str, float] = {}

    @property
    def period(self) -> float:
        """A sample, s on our clock."""
        return self.tags.sample_time / self.rules.speed

    # ---- what is heard ---------------------------------------------------------------------

    def linked(self, alive: bool, now: float) -> list[WriteOrder]:
        """Take in whether the server is heard, and return what is to be written."""
        if alive and not self._alive:
            self._alive_since = now
        if not alive:
            self._writing = None  # nobody will tell what became of it
        self._alive = alive
        return self.look(now)

    def refuse(self, refused: Mapping[str, str], now: float) -> list[WriteOrder]:
        """Take in which tags of any loop the server refuses, and why; return what to write."""
        written = [tag for tag, _ in self.tags.uses()] if self.rules.writes else []
        mine = dict.fromkeys((*self.tags.read_tags(), *written))
        self.refused = tuple(f"tag {tag} {refused[tag]}" for tag in mine if tag in refused)
        return self.look(now)

    def hear(self, tag: str, reading: TagReading, now: float) -> list[WriteOrder]:
        """Take in what was reported of a tag, and return what is to be written."""
        told = self.tags.grant
        if told is not None and tag in (told.heartbeat, told.alive):
            self._hear_beat(told, tag, reading, now)
            return []
        self.sampler.hear(tag, reading, now)
        self._read_at[tag] = now
        if self.rules.writes and any(tag == valve.mode for valve in self.tags.valves):
            return self.look(now)
        return []

    def _hear_beat(self, told: GrantTags, tag: str, reading: TagReading, now: float) -> None:
        """Take in a heartbeat; what counts of it is that it changes, not its stamp."""
        beat = reading.number
        if not np.isfinite(beat):
            return
        if tag == told.alive:
            self._plant.hear(beat, now, reading.first)
        elif identity_of(beat) != self.rules.identity:
            self._foreign.hear(beat, now, reading.first)

    def samples(self, now: float) -> list[PlantSample]:
        """Return the samples that are closed by now."""
        found = self.sampler.due(now, self._alive)
        for sample in found:
            self._stamp = sample.stamp
            good = np.isfinite(sample.pv).all()
            self._bad = 0 if good else self._bad + 1
        return found

    # ---- the grant -------------------------------------------------------------------------

    def ask(self) -> str:
        """Ask for the grant; return why not, empty when it is asked for."""
        if self.grant.state is GrantState.LISTENING:
            return "writing is off"
        if self.grant.state is not GrantState.IDLE:
            return f"{self.grant.state.value} already"
        self.grant = self.grant.ask()
        return ""

    def give_back(self, now: float, reason: str) -> list[WriteOrder]:
        """Leave the valves to the plant, and return what is to be written."""
        self.grant = self.grant.give_back(reason)
        return self.look(now)

    def look(self, now: float) -> list[WriteOrder]:
        """Follow the grant, and return the request and the beat that are to be written."""
        if self.grant.state is GrantState.LISTENING:
            return []
        told, before = self.tags.grant, self.grant.state
        assert told is not None
        modes = (self.sampler.latest(valve.mode) for valve in self.tags.valves)
        self.grant = self.grant.follow(all_grant(modes, told.granted), self._fault(now))
        if self.grant.state is not before:
            self._last = None
        return [*self._request(now), *self._beats(now)]

    def _foreign_beats(self, now: float) -> bool:
        assert self.tags.grant is not None
        return now - self._foreign.changed_at <= self.tags.grant.watchdog

    def _fault(self, now: float) -> str:
        """Return what speaks against writing; empty for nothing."""
        told = self.tags.grant
        assert told is not None
        if not self._alive:
            return "nothing is heard of the server"
        if self.refused:
            return self.refused[0]
        if self._foreign_beats(now):
            return "another one lets the heartbeat rise"
        since = self._alive_since
        if told.alive and now - max(since, self._plant.changed_at) > told.watchdog:
            return "the plant's heartbeat stands still"
        if self._bad >= PATIENCE or self._stamp is None:
            return "PV of bad quality" if self._stamp is not None else "no sample yet"
        for valve in self.tags.valves:
            if self.sampler.latest(valve.mode).quality is not TagQuality.GOOD:
                return f"mode of {valve.name} of bad quality"
        if not np.isfinite(self._op_read()).all():
            return "OP in force of bad quality"
        limits = self.limits()
        if limits is None:
            return "limits of bad quality"
        crossed = limits.crossed([valve.name for valve in self.tags.valves])
        if crossed:
            return crossed
        if not limits.within(self._op_read()):
            return "OP in force beyond its limits"
        if now - self._command_at > stopped_after(self.period):
            return f"no op from {self.op_port.commander or 'anyone'}"
        if self._writing is not None and now > self._writing.expires:
            return "the server does not take an OP in time"
        if not self.grant.requesting and self._told:
            return "the last request is being taken back"
        if not self.grant.requesting and now - since < told.watchdog / SLOW:
            return "listens for other writers"
        return ""

    def _op_read(self) -> FloatArray:
        return np.array([self.sampler.number(valve.op_read) for valve in self.tags.valves])

    def limits(self) -> OpLimits | None:
        """Return the limits in force; None when one that the plant sets is not known."""
        valves, number = self.tags.valves, self.sampler.number
        given = np.array([v.limits for v in valves])
        low = [number(v.low) if v.low else -np.inf for v in valves]
        high = [number(v.high) if v.high else np.inf for v in valves]
        if np.isnan([low, high]).any():
            return None
        rate = np.array([v.rate for v in valves])
        return OpLimits(np.maximum(given[:, 0], low), np.minimum(given[:, 1], high), rate)

    def _request(self, now: float) -> list[WriteOrder]:
        told = self.tags.grant
        assert told is not None
        wanted = 1.0 if self.grant.requesting else 0.0
        if wanted == self._told or not self._alive:
            return []
        if not wanted and self._foreign_beats(now):
            self._told = 0.0  # the request is another one's by now
            return []
        if self._tried is not None and self._tried[0] == wanted and now - self._tried[1] < AGAIN:
            return []
        self._tried = wanted, now
        values = ((told.request, wanted),)
        return [WriteOrder(self.tags.loop, Use.REQUEST, values, now + told.watchdog)]

    def _beats(self, now: float) -> list[WriteOrder]:
        told = self.tags.grant
        assert told is not None
        if not self.grant.requesting or now - self._beat_at < told.watchdog / BEATS:
            return []
        self._beat_at, self._beaten = now, self._beaten + 1
        values = ((told.heartbeat, float(beat_of(self.rules.identity, self._beaten))),)
        return [WriteOrder(self.tags.loop, Use.BEAT, values, now + told.watchdog / BEATS)]

    # ---- the OP ----------------------------------------------------------------------------

    def command(
        self, sender: str, stamp: int, op: FloatArray | None, now: float
    ) -> tuple[Reception, list[WriteOrder]]:
        """Judge an OP, and return what of it is to be written now."""
        present = self._stamp if self._stamp is not None else stamp - 1
        found = self.op_port.judge(sender, stamp, op, present)
        if found not in (Reception.TAKEN, Reception.LATE) or op is None:
            return found, []
        self._command_at = now
        orders = self.look(now)
        if self.grant.may_write:
            orders += self._write(op, now)
        return found, orders

    def _write(self, wanted: FloatArray, now: float) -> list[WriteOrder]:
        limits, told = self.limits(), self.tags.grant
        assert told is not None
        if self._writing is not None:
            self.counts["op_under_way"] += 1
            return []
        if limits is None:
            return []
        in_force, elapsed = self._op_read(), 0.0
        if self._last is not None:
            written, at = self._last
            heard = [self._read_at.get(valve.op_read, at) for valve in self.tags.valves]
            in_force = np.where(np.array(heard) > at, in_force, written)
            elapsed = min((now - at) * self.rules.speed, self.tags.sample_time)
        op = limits.allowed(wanted, in_force, elapsed)
        if (np.abs(op - wanted) > 1e-9).any():
            self.counts["op_limited"] += 1
        if self._last is None:  # the first OP of a grant is the one in force
            self.rate_watch.begin(limits, wanted, in_force)
        elif self.rate_watch.note(limits, wanted, in_force, op):
            self.counts["op_cut_by_rate"] += 1
        values = tuple((v.op, float(x)) for v, x in zip(self.tags.valves, op, strict=True))
        modes = tuple(valve.mode for valve in self.tags.valves)
        expires = now + max(self.period, IN_TIME)
        order = WriteOrder(self.tags.loop, Use.OP, values, expires, modes, told.granted)
        self._writing = order
        return [order]

    def written(
        self, order: WriteOrder, failure: str, seconds: float, now: float
    ) -> list[WriteOrder]:
        """Take in an order with its ``failure``, if any, and seconds; return what to write."""
        told = self.tags.grant
        assert told is not None
        self.counts[f"{order.kind.value}_{'failed' if failure else 'written'}"] += 1
        if order.kind is Use.REQUEST and not failure:
            self._told = order.values[0][1]
        if order.kind is Use.OP:
            if not failure and self._writing is not None:
                self._last = np.array([value for _, value in self._writing.values]), now
            self._writing = None
        if failure and self.grant.requesting:
            return self.give_back(now, f"{order.kind.value} not written: {failure}")
        if seconds > told.watchdog / SLOW and self.grant.requesting:
            return self.give_back(now, f"the server took {seconds:.1f} s to answer")
        return []


def all_grant(modes: Iterable[TagReading], granted: Sequence[str]) -> bool:
    """Return whether every mode has good quality and is one of those that grant writing."""
    return all(one.quality is TagQuality.GOOD and mode_text(one.value) in granted for one in modes)


def mode_text(value: float | str | None) -> str:
    """Return a mode as the tag map writes it: a name, or a whole number."""
    if isinstance(value, str):
        return value
    if value is None or not float(value).is_integer():
        return ""
    return str(int(value))
