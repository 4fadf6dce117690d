"""A loop drawn under given circumstances: its numbers, and what acts on it."""

import dataclasses
import math

import numpy as np

from stiction_studies.field import loads
from stiction_studies.field.circumstances import Circumstances, Friction, Outside, Sampling
from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.loads import Wave
from stiction_studies.field.plants import Plant, Process, draw_process, log_uniform
from stiction_studies.field.simulation import FRICTIONLESS, Clock, Loop, Signals, run
from stiction_studies.field.truth import Cause
from stiction_studies.field.tuning import (
    Answer,
    Wish,
    calm,
    closed_loop_time,
    late,
    step_test,
    tuned,
    ultimate_factor,
)
from stiction_studies.field.valves import Law, Stem, Valve

INTERVALS = (0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 15.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0)
"""Sample times as historians have them, s."""

PER_TIME = {Sampling.USUAL: (2.0, 6.0), Sampling.FAST: (8.0, 30.0), Sampling.SLOW: (0.5, 1.2)}
"""Samples in the time that a loop needs, by sampling."""

LONGEST_STEP = 1.5  # of integration over the fastest time constant; up to 2.7 it is stable
WARM = 25.0  # times of the loop before the record begins
PERIODS = 6.0  # of an outer cycle, that a record holds at least
PER_PERIOD = 8.0  # samples of an outer cycle, at least
NOISE_IN_OP = 0.12  # of the band, that the controller passes on of the noise at most


@dataclasses.dataclass(frozen=True)
class Made:
    """A loop with what acts on it.

    Attributes:
        loop: with its friction.
        signals: at each step of integration.
        warm: steps before the record begins.
        pv_size: what 1 % of the valve makes of PV in the time of the loop, engineering units.
        without: to the causes that may be at work, the loop and signals that lack them.
        steady: the signals without set-point moves that do not repeat, and never in manual.
    """

    loop: Loop
    signals: Signals
    warm: int
    pv_size: float
    without: dict[Cause, tuple[Loop, Signals]]
    steady: Signals


def make(random: np.random.Generator, c: Circumstances, shrink: float = 1.0) -> Made:
    """Draw the numbers of a loop.

    Args:
        random: source of all numbers.
        c: circumstances.
        shrink: factor on the friction that is drawn.
    """
    process = draw_process(random, c.plant)
    answer = step_test(process)
    wish = _wish(random, process)
    clock = _clock(random, c, process, answer, wish)
    delay = late(answer, process, clock.step * clock.scan)
    controller = dataclasses.replace(
        tuned(answer, delay, wish),
        weight=float(random.random() < 0.85),
        velocity=bool(random.random() < 0.6),
    )
    time = closed_loop_time(answer, delay, wish) + delay
    loop = Loop(process, FRICTIONLESS, controller, clock, answer.state)
    loop = mild = calm(loop, answer, time)
    if c.outside is Outside.RINGING:
        factor = ultimate_factor(loop, answer, time) * random.uniform(0.86, 0.97)
        loop = dataclasses.replace(loop, controller=loop.controller.scaled(factor))
    band, valve = _valve(random, c, clock, shrink)
    loop = dataclasses.replace(loop, valve=valve)
    mild = dataclasses.replace(mild, valve=valve)
    acting = _Acting(random, c, loop, answer, time, band)
    return acting.made(mild)


def _wish(random: np.random.Generator, process: Process) -> Wish:
    derivative = 0.0
    if process.kind in ("temperature", "analyser") and random.random() < 0.4:
        derivative = random.uniform(0.2, 0.5)
    filtering = random.uniform(0.2, 1.0) if random.random() < 0.35 else 0.0
    if process.integrating:
        return Wish(random.uniform(2.0, 4.0), random.uniform(0.1, 0.6), derivative, filtering)
    return Wish(random.uniform(1.0, 3.0), random.uniform(0.15, 0.6), derivative, filtering)


def _clock(
    random: np.random.Generator, c: Circumstances, process: Process, answer: Answer, wish: Wish
) -> Clock:
    """Return the steps of time: the sample time first, then the scan, then the integration."""
    delay = late(answer, process, 0.0)
    if not process.integrating:
        delay = max(delay, 0.01 * process.slowest)
    closed = closed_loop_time(answer, delay, wish)
    needed = min(answer.lag, 4.0 * (closed + delay)) + delay
    low, high = PER_TIME[c.sampling]
    wanted = needed / math.exp(random.uniform(math.log(low), math.log(high)))
    sample = min(INTERVALS, key=lambda interval: abs(math.log(interval / wanted)))
    scan = sample / c.scan_ratio
    shorter = min(sample, scan)
    step = shorter / math.ceil(shorter / (LONGEST_STEP * process.fastest))
    return Clock(step, round(scan / step), round(sample / step))


def _valve(
    random: np.random.Generator, c: Circumstances, clock: Clock, shrink: float
) -> tuple[float, Valve]:
    """Return about how wide the band is, %, and the valve."""
    if c.friction is Friction.MUCH:
        band = log_uniform(random, 1.0, 10.0)
    elif c.friction is Friction.FEW_SLIPS:
        band = log_uniform(random, 3.0, 12.0)
    else:
        band = log_uniform(random, 0.02, 0.2) * float(random.random() < 0.7)
    band *= shrink
    scan = clock.step * clock.scan
    natural = scan / random.uniform(10.0, 25.0)
    share = random.uniform(0.5, 0.88)
    if c.law is Law.HE:
        share = random.uniform(0.1, 0.9)
        static = band / (1.0 + share)
    elif c.law is Law.BACKLASH:
        static = band / 2.0
    else:
        static = band / (2.0 - 1.3 * (1.0 - share))
    positioner = float(random.choice([0.0, 0.0, 1.0, 3.0]))
    stem = Stem(
        natural=natural,
        damping=random.uniform(0.7, 2.0),
        lag=random.uniform(0.1, 0.7) * scan,
        positioner=positioner,
        stribeck=max(log_uniform(random, 7e-4, 1.2e-3) * static / natural, 1e-9),
    )
    return band, Valve(c.law, static, share * static, stem)


class _Acting:
    """What acts on one loop; sizes in % of the valve, times in steps of integration."""

    def __init__(
        self,
        random: np.random.Generator,
        c: Circumstances,
        loop: Loop,
        answer: Answer,
        time: float,
        band: float,
    ) -> None:
        self.random, self.c, self.loop, self.answer = random, c, loop, answer
        self.time = time / loop.clock.step
        self.band = band if c.friction is not Friction.NONE else 0.0
        per_percent = answer.gain * (time if math.isinf(answer.lag) else 1.0)
        self.pv_size = abs(per_percent)
        recorded = c.samples * loop.clock.sample
        warm = int(WARM * self.time + 0.1 * recorded)
        self.warm = -(-warm // loop.clock.sample) * loop.clock.sample
        self.count = self.warm + recorded
        self.recorded = recorded

    def made(self, mild: Loop) -> Made:
        """Return the loop and its rivals; ``mild`` is tuned well."""
        drift, wave = self._drift(), self._wave()
        cycle, moves = self._set_points()
        rest = self.loop.rest
        manual = np.zeros(self.count, dtype=np.bool_)
        by_hand = np.zeros(self.count)
        if self.c.manual:
            manual[self.warm :] = loads.stretch(self.random, self.recorded)
            by_hand = loads.hand_moves(self.random, manual, 3.0 * max(self.band, 1.0))
        free = np.zeros(self.count, dtype=np.bool_)
        load = np.maximum((drift + wave) / self.answer.load, -0.9)
        no_wave = np.maximum(drift / self.answer.load, -0.9)
        noise = self._noise()
        steady = Signals(rest + cycle, load, noise, free, by_hand)
        signals = dataclasses.replace(
            steady, set_point=rest + cycle + moves, manual=manual, by_hand=by_hand
        )
        without: dict[Cause, tuple[Loop, Signals]] = {}
        if self.band:
            bare = dataclasses.replace(self.loop, valve=self.loop.valve.without_friction())
            without[Cause.VALVE] = (bare, steady)
        if wave.any():
            quiet = dataclasses.replace(steady, load=no_wave)
            without[Cause.DISTURBANCE] = (self.loop, quiet)
        if self.c.outside is Outside.RINGING:
            without[Cause.TUNING] = (mild, steady)
        if cycle.any():
            still = dataclasses.replace(steady, set_point=np.full(self.count, rest))
            without[Cause.SET_POINT] = (self.loop, still)
        return Made(self.loop, signals, self.warm, self.pv_size, without, steady)

    def _drift(self) -> FloatArray:
        """Return a slow load, and at the start a push that sets a cycle going, %."""
        random = self.random
        if self.band:
            size = random.uniform(0.1, 0.5) * self.band
        elif self.c.outside is Outside.NOTHING:
            size = log_uniform(random, 0.5, 4.0)
        else:
            size = log_uniform(random, 0.1, 0.6)
        slow = 1.0 if self.c.outside is Outside.RINGING else 3.0
        if self.c.friction is Friction.FEW_SLIPS:
            slow = 15.0
        drift = size * loads.coloured(
            random, self.count, slow * log_uniform(random, 1.0, 10.0) * self.time
        )
        drift[: int(0.4 * self.warm)] += random.uniform(1.5, 4.0) * self.band
        return drift

    def _noise(self) -> FloatArray:
        random, clock = self.random, self.loop.clock
        level = (
            random.uniform(0.02, 0.25) * self.band if self.band else log_uniform(random, 0.03, 0.5)
        )
        if self.band:
            passed_on = abs(self.loop.controller.gain) * self.pv_size
            level *= min(1.0, NOISE_IN_OP / (0.25 * passed_on))
        scans = -(-self.count // clock.scan)
        values = loads.coloured(random, scans, self.c.noise_colour)
        return level * self.pv_size * np.repeat(values, clock.scan)[: self.count]

    def _period(self, low: float, high: float) -> float:
        """Return the period of an outer cycle, steps."""
        wanted = log_uniform(self.random, low, high) * self.time
        least = PER_PERIOD * self.loop.clock.sample
        return min(max(wanted, least), self.recorded / PERIODS)

    def _amplitude(self) -> float:
        if not self.band:
            return log_uniform(self.random, 2.0, 10.0)
        if self.c.law is Law.BACKLASH:
            return self.random.uniform(1.0, 3.0) * self.band
        return self.random.uniform(0.3, 1.5) * self.band

    def _wave(self) -> FloatArray:
        """Return the load from outside, %."""
        outside = self.c.outside
        if outside in (Outside.NOTHING, Outside.RINGING, Outside.SET_POINT):
            return np.zeros(self.count)
        period = self._period(5.0, 40.0)
        if outside is Outside.NEIGHBOUR:
            return self._amplitude() * _neighbour(self.random, self.count, period)
        time = np.arange(self.count, dtype=np.float64)
        shape = Wave(outside.value)
        phase = self.random.uniform(0.0, 1.0)
        return self._amplitude() * loads.wave(shape, time, period, phase)

    def _set_points(self) -> tuple[FloatArray, FloatArray]:
        """Return the set-point's cycle and its moves, engineering units."""
        cycle, moves = np.zeros(self.count), np.zeros(self.count)
        if self.c.outside is Outside.SET_POINT:
            half = 0.5 * self._period(8.0, 40.0)
            cycle = (
                self._amplitude()
                * self.pv_size
                * loads.moves(self.random, self.count, half, regular=True)
            )
        if self.c.set_point_moves:
            size = self.random.uniform(2.0, 6.0) * max(self.band, 1.0) * self.pv_size
            interval = self.recorded / self.random.uniform(3.0, 12.0)
            moves = size * loads.moves(self.random, self.count, interval, regular=False)
        return cycle, moves


def _neighbour(random: np.random.Generator, count: int, period: float) -> FloatArray:
    """Return the swing of a level loop with a sticky valve, amplitude 1, shape (count,).

    The other loop is simulated in its own time, which is then stretched to the period.
    """
    process = draw_process(random, Plant.LEVEL)
    answer = step_test(process)
    wish = Wish(random.uniform(2.0, 5.0), 0.3)
    delay = max(late(answer, process, 0.0), process.fastest)
    time = closed_loop_time(answer, delay, wish) + delay
    step = min(process.fastest, time / 20.0)
    valve = Valve(Law.HE, 4.0, random.uniform(0.5, 3.0))
    loop = Loop(process, valve, tuned(answer, delay, wish), Clock(step, 1, 1), answer.state)
    steps = int(400.0 * time / step)
    load = np.zeros(steps)
    load[: steps // 20] = 8.0 / answer.load
    out = run(loop, dataclasses.replace(Signals.quiet(steps, loop.rest), load=load))
    stem = out.stem[steps // 3 :] - out.stem[steps // 3 :].mean()
    rises = np.flatnonzero((stem[:-1] < 0.0) & (stem[1:] >= 0.0))
    if len(rises) < 3:  # it came to rest: a relay's swing instead
        return loads.wave(Wave.SQUARE, np.arange(count, dtype=np.float64), period, 0.0)
    one = stem[rises[0] : rises[-1]] / (0.5 * np.ptp(stem))
    turns = len(rises) - 1
    at = np.mod(np.arange(count) / period, turns) * len(one) / turns
    swing = np.interp(at, np.arange(len(one)), one)
    return np.asarray(swing)
