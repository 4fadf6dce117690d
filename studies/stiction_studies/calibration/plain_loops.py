"""A world of textbook loops: linear process, PI controller, one valve, one sensor, plain Python.

Nothing is shared with the package or with :mod:`stiction_studies.field`. Friction is that of He,
Kano or Choudhury, of a stem with mass and Coulomb friction, or a deadband. Sensors hold, repeat
and round. Loads walk, step and swing. A valve may be stuck.
"""

import dataclasses
import itertools
import math

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.record import Record

LAWS = ("he", "kano", "choudhury", "mechanics", "deadband")
SENSORS = ("plain", "stale", "wireless", "exception", "rounded")
LOADS = ("walk", "coloured", "steps", "sine", "square", "triangle", "drifting_cycle")
MASTERS = ("walk", "coloured", "steps", "sine")
# but plain: little but the valve moves the loop; a master moves SP, which is not recorded; the load
# is a large regular wave; the valve of another loop, the first of the record, moves PV as well
WORLDS = {"plain": 0, "quiet": 1, "cascade": 2, "waves": 4, "pair": 8}
SUBSTEPS = 40  # of the stem's mechanics in a sample
HUSH, LITTLE = 0.2, 0.1  # of noise and load on a quiet loop: a valve makes a plain limit cycle
LEAD = 500  # samples before the record, in which a cycle settles
MANY = 6  # slips from which a record shows friction
MATTERS = 0.1  # band over the range of OP, least of a friction that matters


@dataclasses.dataclass(frozen=True)
class PlainLoop:
    """One recorded loop and the truth."""

    record: Record  # OP, PV and SP
    law: str  # of the friction; none without, stuck where the stem stands still
    band: float  # f_S + f_D, % (of a stem with mass: of its forces)
    jump: float  # f_S − f_D, likewise
    slips: int  # of the stem over the record
    op_range: float  # of OP, 2 % to 98 %
    stem: FloatArray  # shape (N,), % about 50 %

    @property
    def friction(self) -> bool | None:
        """Whether there is friction that matters; None where too few slips show it."""
        if self.law in ("none", "stuck"):
            return False
        shown = self.slips >= MANY and self.band >= MATTERS * self.op_range
        return True if shown else None


def plain_loop(
    seed: int, law: str | None = None, sensor: str | None = None, world: str = "plain"
) -> PlainLoop:
    """Return the loop of a seed.

    Args:
        seed: 0 or more.
        law: of the valve, of :data:`LAWS`, ``none`` or ``stuck``; drawn where None.
        sensor: of :data:`SENSORS`; drawn where None.
        world: of :data:`WORLDS`.
    """
    quiet, cascade, waves, pair = (world == name for name in list(WORLDS)[1:])
    random = np.random.default_rng([seed, 4711, WORLDS[world]])
    drawn = random.choice(["none", "stuck", *LAWS], p=[0.47, 0.03, 0.14, 0.1, 0.1, 0.1, 0.06])
    law = law or str(drawn)
    kept = str(random.choice(SENSORS, p=[0.5, 0.14, 0.12, 0.12, 0.12]))
    sensor = sensor or kept
    count = LEAD + int(random.integers(900, 3000))
    kind = str(random.choice(["first", "second", "level"], p=[0.4, 0.35, 0.25]))
    lag, delay = _log(random, 3.0, 25.0), int(random.integers(0, 7))
    gain = _log(random, 0.3, 3.0) * float(random.choice([-1.0, 1.0]))
    patience = _log(random, 0.7, 12.0)  # closed-loop time over the dead time: brisk to sluggish
    controller = "ringing" if law == "none" and random.random() < 0.12 else "calm"
    controller = "gap" if kind == "level" and random.random() < 0.15 else controller
    band = _log(random, 1.0, 10.0) if law in LAWS else 0.0
    static = band / (2.0 - random.uniform(0.1, 0.8)) if law != "deadband" else 0.5 * band
    load = str(random.choice(LOADS, p=[0.3, 0.2, 0.1, 0.12, 0.1, 0.08, 0.1]))
    load = str(random.choice(LOADS[3:6])) if waves else load
    neighbour = None
    if pair:
        neighbour = plain_loop(seed, str(random.choice(["none", *LAWS])))
        count = LEAD + len(neighbour.stem)
    outside = _load(random, load, count, lag + delay)
    size = band * random.uniform(0.1, 0.6) if band else _log(random, 0.3, 4.0)
    size = 2.0 * size if waves else size
    loop = _Loop(kind, lag, delay, gain, patience, controller, law, static, band - static)
    hush = HUSH if quiet else 1.0
    size = LITTLE * size if quiet else size
    noise = _noise(random, count) * abs(gain) * 0.05 * max(band, 1.0)
    noise *= hush * random.uniform(0.2, 1.0)
    swing = abs(gain) * max(band, 2.0)
    if cascade:
        master = str(random.choice(MASTERS))
        moves = swing * _log(random, 0.1, 1.0) * _load(random, master, count, 3.0 * (lag + delay))
    else:
        moves = _set_points(random, count, swing)
    push = np.zeros(count)
    push[:50] = 2.0 * band  # sets a cycle going
    if neighbour is not None:
        much = _log(random, 0.1, 1.0)
        share = math.exp(-1.0 / (_log(random, 0.3, 3.0) * lag))
        away = neighbour.stem - neighbour.stem.mean()
        push[LEAD:] += much * _filtered(away, share, 1.0 - share)
    told = loop.run(size * outside + push, noise, moves, Sensor(sensor, random, gain))
    op, stem, pv = (signal[LEAD:] for signal in told)
    span = float(np.subtract(*np.percentile(op, [98.0, 2.0])))
    record = Record(
        name=f"{world}{seed:05d}",
        sample_time=1.0,
        valves=("V1",),
        outputs=("PV1",),
        op=(50.0 + op)[:, None],
        pv=(20.0 + pv)[:, None],
        sp=None if cascade else (20.0 + moves[LEAD:])[:, None],
    )
    if neighbour is not None:
        record = _joined(neighbour.record, record)
    slips = _slips(stem, max(0.25 * (2.0 * static - band), 0.02 * band))
    return PlainLoop(record, law, band, 2.0 * static - band, slips, span, stem)


def _joined(one: Record, two: Record) -> Record:
    op, pv = np.hstack([one.op, two.op]), np.hstack([one.pv, two.pv])
    sp = None if one.sp is None or two.sp is None else np.hstack([one.sp, two.sp])
    valves, outputs = ("V1", "V2"), ("PV1", "PV2")
    return dataclasses.replace(two, valves=valves, outputs=outputs, op=op, pv=pv, sp=sp)


@dataclasses.dataclass(frozen=True)
class _Loop:
    kind: str
    lag: float
    delay: int
    gain: float
    patience: float
    controller: str
    law: str
    static: float
    dynamic: float

    def run(
        self, load: FloatArray, noise: FloatArray, set_point: FloatArray, sensor: "Sensor"
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return OP, stem and measured PV about their rest, shape (N,) each."""
        count, valve = len(load), _Valve(self.law, self.static, self.dynamic)
        late = self.delay + 1
        closed = self.patience * (self.delay + 1.5 + sensor.age)
        if self.kind == "level":
            slope = self.gain / self.lag
            kp, ti = 1.0 / (slope * (closed + late)), 4.0 * (closed + late)
        else:
            kp = self.lag / (self.gain * (closed + late))
            ti = min(self.lag, 4.0 * (closed + late))
        if self.controller == "ringing":
            kp, ti = 1.8 * kp, 0.45 * ti
        share = math.exp(-1.0 / self.lag)
        fast = math.exp(-1.0 / (0.3 * self.lag))
        op, stem, pv = np.zeros(count), np.zeros(count), np.zeros(count)
        first = second = 0.0
        u = error_before = 0.0
        for k in range(count):
            driven = (stem[k - late] if k >= late else 0.0) + load[k]
            if self.kind == "level":
                first += self.gain / self.lag * driven
                value = first
            else:
                first = share * first + (1.0 - share) * self.gain * driven
                second = fast * second + (1.0 - fast) * first
                value = second if self.kind == "second" else first
            pv[k] = sensor.read(value + noise[k])
            error = set_point[k] - pv[k]
            if self.controller == "gap" and abs(error) < 0.5 * abs(self.gain):
                error = 0.0
            u += kp * (error - error_before) + kp / ti * error
            u = min(max(u, -50.0), 50.0)
            error_before = error
            op[k], stem[k] = u, valve.follow(u)
        return op, stem, pv


class _Valve:
    """One stem; OP and stem in % about 50 %."""

    def __init__(self, law: str, static: float, dynamic: float) -> None:
        self.law, self.static, self.dynamic = law, static, dynamic
        self.stem = self.speed = self.pressure = 0.0
        self.before, self.way, self.at, self.sticks = 0.0, 1.0, 0.0, True

    def follow(self, op: float) -> float:
        if self.law == "none":
            self.stem = op
        elif self.law == "he":
            if abs(op - self.stem) > self.static:
                self.stem = op - math.copysign(self.dynamic, op - self.stem)
        elif self.law == "deadband":
            self.stem = min(max(self.stem, op - self.static), op + self.static)
        elif self.law in ("kano", "choudhury"):
            self._data_driven(op)
        elif self.law == "mechanics":
            self._mechanics(op)
        return self.stem

    def _data_driven(self, op: float) -> None:
        """Step the law of Kano (2004) or Choudhury (2005): S and J, and whether OP goes on."""
        band, jump = self.static + self.dynamic, self.static - self.dynamic
        move = op - self.before
        if not self.sticks:
            turned = move * self.way < 0.0
            rests = move == 0.0 and self.law == "choudhury"
            if turned or rests:
                self.sticks, self.at = True, self.before
            else:
                self.stem = op - self.way * self.dynamic
        if self.sticks:
            gone = op - self.at
            if -self.way * gone > band:
                self.way, self.sticks = -self.way, False
            elif self.way * gone > jump:
                self.sticks = False
            if not self.sticks:
                self.stem = op - self.way * self.dynamic
        self.before = op

    def _mechanics(self, op: float) -> None:
        """Integrate mass, damping, spring and Coulomb friction behind a first-order actuator."""
        step = 1.0 / SUBSTEPS
        for _ in range(SUBSTEPS):
            self.pressure += step / 0.3 * (op - self.pressure)
            force = self.pressure - self.stem
            if self.speed == 0.0 and abs(force) <= self.static:
                continue
            way = self.speed if self.speed != 0.0 else force
            push = force - math.copysign(self.dynamic, way) - 0.25 * self.speed
            speed = self.speed + step / 0.02 * push
            if speed * way <= 0.0 and self.speed != 0.0:
                speed = 0.0
            self.speed = speed
            self.stem += step * speed


class Sensor:
    """What becomes of PV between process and record."""

    def __init__(self, kind: str, random: np.random.Generator, gain: float) -> None:
        self.kind, self.random = kind, random
        self.width = abs(gain) * float(random.uniform(0.05, 0.4))
        self.refresh = int(random.integers(4, 11))
        self.age = {"wireless": float(self.refresh), "stale": 5.0}.get(kind, 0.0)  # samples
        self.left, self.value, self.row = 0, 0.0, -1

    def read(self, value: float) -> float:
        """Return what is read of the true value."""
        self.row += 1
        if self.kind == "rounded":
            return round(value / self.width) * self.width
        if self.kind == "exception":
            fresh = abs(value - self.value) > self.width
        elif self.kind == "wireless":
            fresh = self.row % self.refresh == 0
        elif self.kind == "stale":
            if self.left > 0:
                self.left -= 1
            elif self.random.random() < 0.012:
                self.left = int(self.random.integers(10, 41))
            fresh = self.left == 0
        else:
            fresh = True
        self.value = value if fresh else self.value
        return self.value


def _log(random: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def _noise(random: np.random.Generator, count: int) -> FloatArray:
    white = random.standard_normal(count)
    share = 0.0 if random.random() < 0.5 else random.uniform(0.3, 0.9)
    return _filtered(white, share, math.sqrt(1.0 - share**2))


def _filtered(white: FloatArray, share: float, scale: float) -> FloatArray:
    """Return values behind a lag: ``share`` of the last one and ``scale`` of the new one."""
    out, value = np.empty_like(white), 0.0
    for k, shock in enumerate(white.tolist()):
        value = share * value + scale * shock
        out[k] = value
    return out


def _load(random: np.random.Generator, kind: str, count: int, time: float) -> FloatArray:
    """Return a load of about unit size, shape (count,)."""
    rows = np.arange(count)
    if kind == "walk":
        walk = np.cumsum(random.standard_normal(count))
        return np.asarray((walk - walk.mean()) / max(np.ptp(walk), 1e-9) * 4.0)
    if kind == "coloured":
        share = math.exp(-1.0 / (3.0 * time))
        return _filtered(random.standard_normal(count), share, math.sqrt(1.0 - share**2))
    if kind == "steps":
        jumps = np.where(random.random(count) < 4.0 / count, random.normal(0.0, 2.0, count), 0.0)
        return np.asarray(np.cumsum(jumps))
    period = time * _log(random, 4.0, 20.0)
    period = min(period, count / 8.0)
    if kind == "drifting_cycle":  # of another loop: no two turns are equally long
        phase = np.cumsum(1.0 / (period * (1.0 + 0.1 * random.standard_normal(count))))
        phase += 0.02 * np.cumsum(random.standard_normal(count)) / math.sqrt(period)
    else:
        phase = rows / period
    turn = np.mod(phase, 1.0)
    if kind == "square":
        return np.asarray(np.where(turn < 0.5, 1.0, -1.0))
    if kind == "triangle":
        return np.asarray(4.0 * np.abs(turn - 0.5) - 1.0)
    return np.asarray(np.sin(2.0 * np.pi * phase))


def _set_points(random: np.random.Generator, count: int, size: float) -> FloatArray:
    out = np.zeros(count)
    if random.random() < 0.25:
        for row in random.integers(0, count, 4):
            out[int(row) :] = size * random.uniform(-2.0, 2.0)
    return out


def _slips(stem: FloatArray, least: float) -> int:
    """Return how many runs of moves in one direction are at least ``least`` long."""
    moves = np.diff(stem)
    way = np.sign(np.where(np.abs(moves) > 0.05 * max(least, 1e-9), moves, 0.0))
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], way, [0.0]])))
    runs = [moves[a:b].sum() for a, b in itertools.pairwise(edges) if way[a]]
    return sum(abs(run) >= least for run in runs)
