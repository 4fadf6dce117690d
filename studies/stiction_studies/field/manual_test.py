"""Valves of the field that are tested in manual: what happens when OP is moved by steps.

Two thirds have friction, f_S of .5 to 10 % evenly over its logarithm: half of them by He's law, the
rest by the mechanics of Karnopp and of LuGre. A third is ideal. Noise and drift do not tell which:
both are drawn beside a friction also where there is none. Noise is .02 to .25 of its band, at most
half a per cent of the valve; a load drifts by up to .6 %. Some PVs are rounded, some go stale.
"""

import dataclasses
import functools
import math

import numpy as np

from stiction_studies.field import loads
from stiction_studies.field.circumstances import choice
from stiction_studies.field.drawing import INTERVALS, LONGEST_STEP
from stiction_studies.field.historian import rounded
from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.plants import Plant, draw_process, log_uniform
from stiction_studies.field.simulation import FRICTIONLESS, Clock, Controller, Loop, Signals, run
from stiction_studies.field.truth import ValveKind
from stiction_studies.field.tuning import Answer, Wish, closed_loop_time, late, step_test
from stiction_studies.field.valves import Law, Stem, Valve, slow_triangle

STATIC = (0.5, 10.0)  # %: f_S
NOISIEST = 0.5  # % of the valve
SAMPLES_PER_TIME = (5.0, 15.0)  # in dead time and lag
MOST = 4000  # samples of a test


@dataclasses.dataclass(frozen=True)
class ManualTest:
    """One valve in manual, and what is true of it.

    Attributes:
        seed: that it came from.
        loop: valve and plant.
        signals: that act on it while it is tested.
        answer: of the plant to its valve.
        time: dead time and lag, s; of a level, the time in which its loop would be closed.
        lead: of OP over the stem at the start, %.
        noise: standard deviation of the transmitter's noise, engineering units.
        colour: time constant of the noise, samples; 0 is white.
        step: of the rounding of PV, same units; 0 is none.
        stale: first sample, and the one behind the last, in which PV shows no news.
        circumstances: names of what is not usual.
    """

    seed: int
    loop: Loop
    signals: Signals
    answer: Answer
    time: float
    lead: float
    noise: float
    colour: float
    step: float
    stale: tuple[tuple[int, int], ...]
    circumstances: tuple[str, ...]

    @property
    def kind(self) -> ValveKind:
        """Sticky or healthy."""
        return ValveKind.STICKY if self.loop.valve.static else ValveKind.HEALTHY

    @functools.cached_property
    def f_s(self) -> float:
        """The lead of OP at which the stem breaks loose, %.

        Of stem mechanics it is half of the band and the jump of a slow triangle.
        """
        valve = self.loop.valve
        if valve.law is Law.HE or not valve.static:
            return valve.static
        shown = slow_triangle(valve)
        return 0.5 * (shown.band + shown.jump)

    @property
    def sample_time(self) -> float:
        """Seconds between two samples."""
        return self.loop.clock.step * self.loop.clock.sample

    @property
    def settles(self) -> bool:
        """Whether PV has a steady state of its own."""
        return not self.loop.process.integrating

    @property
    def op(self) -> float:
        """OP at the start, %."""
        return self.loop.process.stem + self.lead

    def pv(self, op: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return PV as it is recorded, and without noise, for OP at the samples, (N,) each."""
        steps = self.loop.clock.sample
        count = len(op) * steps
        acting = self.signals
        acting = Signals(
            acting.set_point[:count],
            acting.load[:count],
            acting.noise[:count],
            acting.manual[:count],
            np.repeat(op - self.loop.process.stem, steps),
        )
        out = run(self.loop, acting)
        shown = out.pv[steps - 1 :: steps].copy()
        if self.step:
            shown = rounded(shown, self.step)
        for first, last in self.stale:
            shown[first:last] = shown[first - 1 : first]
        return shown, out.clean[steps - 1 :: steps]


def manual_test(seed: int) -> ManualTest:
    """Return the valve of a seed; seeds below 1000 are for tuning, from 50 000 on for reporting."""
    random = np.random.default_rng([seed, 47])
    level = random.random() < 1.0 / 3.0
    flows = {Plant.FLOW: 1.0, Plant.PRESSURE: 1.0, Plant.EXCHANGER: 1.0}
    process = draw_process(random, Plant.LEVEL if level else choice(random, flows))
    answer = step_test(process)
    delay = late(answer, process, 0.0)
    lag = answer.lag
    if math.isinf(lag):
        lag = closed_loop_time(answer, max(delay, process.fastest), Wish(3.0, 0.3))
    wanted = (lag + delay) / log_uniform(random, *SAMPLES_PER_TIME)
    sample = min(INTERVALS, key=lambda interval: abs(math.log(interval / wanted)))
    step = sample / math.ceil(sample / (LONGEST_STEP * process.fastest))
    scan = round(sample / step)
    static, share, drawn = _valve(random, sample)
    valve = FRICTIONLESS if seed % 3 == 2 else drawn
    band = static * (1.0 + share)
    per = abs(answer.gain * (lag if level else 1.0))
    noise = min(random.uniform(0.02, 0.25) * band, NOISIEST) * per
    colour = float(random.choice([0.0, 0.0, 2.0, 6.0]))
    values = noise * np.repeat(loads.coloured(random, MOST, colour), scan)
    drift = min(random.uniform(0.1, 0.5) * band, log_uniform(random, 0.1, 0.6))
    slow = 3.0 * log_uniform(random, 1.0, 10.0) * (lag + delay) / step
    load = drift * loads.coloured(random, MOST * scan, slow)
    load = np.maximum((load - load[0]) / answer.load, -0.9)
    loop = Loop(process, valve, Controller(1.0, 1.0), Clock(step, scan, scan), answer.state)
    quiet = Signals.quiet(MOST * scan, loop.rest, by_hand=0.0)
    coarse = random.random() < 0.25
    stale = random.random() < 0.2
    return ManualTest(
        seed=seed,
        loop=loop,
        signals=dataclasses.replace(quiet, load=load, noise=values),
        answer=answer,
        time=lag + delay,
        lead=random.uniform(-0.9, 0.9) * valve.static,
        noise=noise,
        colour=colour,
        step=noise * log_uniform(random, 0.5, 3.0) if coarse else 0.0,
        stale=_stretches(random) if stale else (),
        circumstances=tuple(
            name
            for name, there in (
                ("rounded", coarse),
                ("stale", stale),
                ("coloured_noise", colour > 0.0),
            )
            if there
        ),
    )


def _valve(random: np.random.Generator, sample: float) -> tuple[float, float, Valve]:
    """Return f_S, f_D over it, and the valve."""
    law = choice(random, {Law.HE: 2, Law.KARNOPP: 1, Law.LUGRE: 1})
    static = log_uniform(random, *STATIC)
    share = random.uniform(0.1, 0.9) if law is Law.HE else random.uniform(0.5, 0.88)
    natural = sample / random.uniform(10.0, 25.0)
    stem = Stem(
        natural=natural,
        damping=random.uniform(0.7, 2.0),
        lag=random.uniform(0.1, 0.7) * sample,
        positioner=float(random.choice([0.0, 0.0, 1.0, 3.0])),
        stribeck=max(log_uniform(random, 7e-4, 1.2e-3) * static / natural, 1e-9),
    )
    return static, share, Valve(law, static, share * static, stem)


def _stretches(random: np.random.Generator) -> tuple[tuple[int, int], ...]:
    """Return stretches of 5 to 25 samples, some 120 apart."""
    found, at = [], 20
    while at < MOST:
        at += int(random.exponential(120.0)) + 1
        length = int(random.integers(5, 26))
        found.append((at, at + length))
        at += length
    return tuple(found)
