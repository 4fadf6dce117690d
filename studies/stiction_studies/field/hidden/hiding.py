"""What can be hidden in a loop, and how large it is drawn.

Sizes are such as matter in a plant: friction of 2 to 12 % of travel, loads worth 1.5 to 5 % of
the valve, lags about as long as the plant's own. A quarter of the loops has half of that.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from stiction_studies.field.hidden import effect as places
from stiction_studies.field.hidden.effect import Effect
from stiction_studies.field.hidden.simulation import LEAD, Base, Run
from stiction_studies.field.kernels import FloatArray

LONGEST_LAG = 40.0  # samples


@dataclasses.dataclass(frozen=True)
class Draw:
    """From what the size of an effect is drawn."""

    random: np.random.Generator  # source of all numbers
    base: Base  # the healthy loop
    reference: Run  # its run under the same signals
    unit: float  # what 1 % of the valve makes of PV, engineering units
    noise: float  # standard deviation of the white noise that PV shows
    samples: int  # of the record
    scale: float  # factor on the size

    def within(self, low: float, high: float) -> float:
        """Return a number between the two, scaled."""
        return self.scale * float(self.random.uniform(low, high))

    def sign(self) -> float:
        """Return −1 or 1."""
        return float(self.random.choice([-1.0, 1.0]))

    @property
    def seconds(self) -> float:
        """Length of the record."""
        return self.samples * self.base.sample_time

    @property
    def op(self) -> FloatArray:
        """OP of the healthy loop in the record, shape (N,)."""
        return self.reference.op[LEAD:]

    @property
    def pv(self) -> FloatArray:
        """PV of the healthy loop in the record, shape (N,)."""
        return self.reference.pv[LEAD:]

    def onset(self) -> float:
        """Return the time of a sample in the middle three fifths, s."""
        return round(float(self.random.uniform(0.2, 0.8)) * self.samples) * self.base.sample_time

    def lag(self) -> float:
        """Return a time constant about as long as the plant is slow, s."""
        plant, sample = self.base.plant, self.base.sample_time
        slow = min((plant.slow + plant.dead_time) / sample, LONGEST_LAG)
        return max(self.within(0.4, 1.2) * slow, 1.0) * sample

    def period(self) -> float:
        """Return the period of a wave, s."""
        samples = math.exp(self.random.uniform(math.log(15.0), math.log(250.0)))
        return samples * self.base.sample_time


def _he(draw: Draw) -> Effect:
    static = draw.within(2.0, 8.0)
    sliding = static * float(draw.random.uniform(0.1, 0.75))
    return Effect(places.VALVE, "stiction", {"f_s": static, "f_d": sliding})


def _mechanics(law: str) -> Callable[[Draw], Effect]:
    def drawn(draw: Draw) -> Effect:
        static, natural = draw.within(2.0, 8.0), 1.0 / float(draw.random.uniform(10.0, 25.0))
        figures = {
            "static": static,
            "sliding": static * float(draw.random.uniform(0.5, 0.88)),
            "natural": natural,
            "damping": float(draw.random.uniform(0.7, 2.0)),
            "lag": float(draw.random.uniform(0.1, 0.5)),
            "stribeck": 1e-3 * static / natural,
        }
        return Effect(places.VALVE, "stiction", figures, law)

    return drawn


def _backlash(draw: Draw) -> Effect:
    return Effect(places.VALVE, "backlash", {"band": draw.within(3.0, 12.0)})


def _slew(draw: Draw) -> Effect:
    """A rate at which the largest moves of OP take 6 to 25 samples."""
    largest = max(float(np.quantile(np.abs(draw.op[5:] - draw.op[:-5]), 0.995)), 0.2)
    ramp = max(draw.within(6.0, 25.0), 2.0)
    rate = largest / ramp / draw.base.sample_time
    return Effect(places.VALVE, "slew", {"rate": rate}, slack={"rate": rate / ramp})


def _lag(place: str, name: str) -> Callable[[Draw], Effect]:
    def drawn(draw: Draw) -> Effect:
        return Effect(place, name, {"tau": draw.lag()}, slack={"tau": draw.base.sample_time})

    return drawn


def _saturation(draw: Draw) -> Effect:
    """Cuts off 10 to 30 % of the time of the healthy loop's OP."""
    share = draw.within(0.1, 0.3)
    ends = {"low": 0.0, "high": 100.0}
    if draw.random.random() < 0.5:
        ends["high"], free = float(np.quantile(draw.op, 1.0 - share)), "low"
    else:
        ends["low"], free = float(np.quantile(draw.op, share)), "high"
    return Effect(places.VALVE, "saturation", ends, untold=(free,))


def _characteristic(draw: Draw) -> Effect:
    sign = draw.sign()
    if draw.random.random() < 0.5:
        return Effect(places.VALVE, "characteristic", {"curve": sign * draw.within(1.0, 3.0)})
    law = "quadratic" if sign > 0.0 else "in a line"
    curve = {"curve": draw.within(0.5, 0.9)}
    return Effect(places.VALVE, "characteristic", curve, law, ("curve",))


def _offset(draw: Draw) -> Effect:
    return Effect(places.VALVE, "offset", {"size": draw.sign() * draw.within(2.0, 8.0)})


def _gain(draw: Draw) -> Effect:
    factor = math.exp(draw.sign() * draw.within(0.25, 0.6))
    return Effect(places.PROCESS, "gain", {"factor": factor})


def _delay(draw: Draw) -> Effect:
    return Effect(places.PROCESS, "delay", {"extra": float(max(round(draw.within(2.0, 8.0)), 1))})


def _leak(draw: Draw) -> Effect:
    rate = draw.scale / (float(draw.random.uniform(40.0, 150.0)) * draw.base.sample_time)
    return Effect(places.PROCESS, "leak", {"rate": rate})


def _size(draw: Draw, place: str) -> float:
    """Return 1 where it adds to the stem, else what 1 % makes of PV."""
    return 1.0 if place == places.LOAD else draw.unit


def _step(place: str, name: str = "step") -> Callable[[Draw], Effect]:
    def drawn(draw: Draw) -> Effect:
        size = draw.sign() * draw.within(1.5, 5.0) * _size(draw, place)
        return Effect(place, name, {"time": draw.onset(), "size": size})

    return drawn


def _drift(place: str) -> Callable[[Draw], Effect]:
    def drawn(draw: Draw) -> Effect:
        rate = draw.sign() * draw.within(3.0, 8.0) * _size(draw, place) / draw.seconds
        return Effect(place, "drift", {"rate": rate})

    return drawn


def _wave(place: str, name: str) -> Callable[[Draw], Effect]:
    def drawn(draw: Draw) -> Effect:
        figures = {
            "amplitude": draw.within(0.6, 2.5) * _size(draw, place),
            "period": draw.period(),
            "phase": float(draw.random.uniform(0.0, 2.0 * math.pi)),
        }
        turned = 2.0 * math.pi * draw.base.sample_time / figures["period"]
        return Effect(place, name, figures, slack={"phase": turned})

    return drawn


def _walk(place: str) -> Callable[[Draw], Effect]:
    """A walk that is 2 to 6 % of the valve away at the end, about."""

    def drawn(draw: Draw) -> Effect:
        rate = draw.within(2.0, 6.0) / math.sqrt(draw.seconds) * _size(draw, place)
        seed = float(draw.random.integers(2**31))
        return Effect(place, "random_walk", {"rate": rate, "seed": seed})

    return drawn


def _coloured(draw: Draw) -> Effect:
    figures = {
        "std": draw.within(0.6, 2.0) * draw.unit,
        "tau": float(draw.random.uniform(5.0, 40.0)) * draw.base.sample_time,
        "seed": float(draw.random.integers(2**31)),
    }
    return Effect(places.OUTPUT, "coloured", figures)


def _quantisation(draw: Draw) -> Effect:
    return Effect(places.SENSOR, "quantisation", {"step": draw.within(4.0, 12.0) * draw.noise})


def _freeze(draw: Draw) -> Effect:
    figures = {"time": draw.onset(), "duration": draw.within(0.04, 0.15) * draw.seconds}
    slack = {"time": draw.base.sample_time, "duration": draw.base.sample_time}
    return Effect(places.SENSOR, "freeze", figures, slack=slack)


def _clip(draw: Draw) -> Effect:
    share, spread = draw.within(0.06, 0.2), float(np.ptp(draw.pv)) + 20.0 * draw.unit
    figures = {"low": float(draw.pv.min()) - spread, "high": float(draw.pv.max()) + spread}
    if draw.random.random() < 0.5:
        figures["high"], free = float(np.quantile(draw.pv, 1.0 - share)), "low"
    else:
        figures["low"], free = float(np.quantile(draw.pv, share)), "high"
    return Effect(places.SENSOR, "clip", figures, untold=(free,))


def _tuning(draw: Draw) -> Effect:
    tuning, weaker = draw.base.tuning, math.exp(-draw.within(0.25, 0.9))
    gain, integral = tuning.gain, tuning.integral_time
    if draw.random.random() < 0.5:
        gain *= weaker
    else:
        integral /= weaker
    return Effect(places.DATA, "tuning", {"gain": gain, "integral_time": integral})


def _time_shift(draw: Draw) -> Effect:
    shift = float(max(round(draw.within(2.0, 6.0)), 1))
    return Effect(places.DATA, "time_shift", {"shift": shift})


@dataclasses.dataclass(frozen=True)
class Kind:
    """One kind of effect: how it is drawn, and how often."""

    draw: Callable[[Draw], Effect]  # returns the effect
    share: float = 1.0  # among all
    first: bool = False  # whether it is one of two that can be told from a load
    second: bool = False  # whether it is such a load


KINDS = {
    "valve stiction": Kind(_he, 1.8, first=True),
    "valve stiction karnopp": Kind(_mechanics("karnopp"), 0.7, first=True),
    "valve stiction lugre": Kind(_mechanics("lugre"), 0.7, first=True),
    "valve backlash": Kind(_backlash, 1.8, first=True),
    "valve slew": Kind(_slew, 1.4, first=True),
    "valve lag": Kind(_lag(places.VALVE, "lag"), 0.9),
    "valve saturation": Kind(_saturation, 2.0, first=True),
    "valve characteristic": Kind(_characteristic, 1.8, first=True),
    "valve offset": Kind(_offset, 0.3),
    "process gain": Kind(_gain, 1.4, first=True),
    "process delay": Kind(_delay, 1.4, first=True),
    "process pole": Kind(_lag(places.PROCESS, "pole"), 0.9),
    "process leak": Kind(_leak, 1.0),
    "load step": Kind(_step(places.LOAD), 1.8, second=True),
    "load drift": Kind(_drift(places.LOAD), 0.7, second=True),
    "load sine": Kind(_wave(places.LOAD, "sine"), 0.8, second=True),
    "load square": Kind(_wave(places.LOAD, "square"), 0.8, second=True),
    "load triangle": Kind(_wave(places.LOAD, "triangle"), 0.5),
    "load random_walk": Kind(_walk(places.LOAD), 0.8),
    "disturbance step": Kind(_step(places.OUTPUT), 1.0, second=True),
    "disturbance drift": Kind(_drift(places.OUTPUT), 0.8, second=True),
    "disturbance sine": Kind(_wave(places.OUTPUT, "sine"), 0.8, second=True),
    "disturbance square": Kind(_wave(places.OUTPUT, "square"), 0.6),
    "disturbance triangle": Kind(_wave(places.OUTPUT, "triangle"), 0.5),
    "disturbance random_walk": Kind(_walk(places.OUTPUT), 0.7),
    "disturbance coloured": Kind(_coloured, 1.0),
    "sensor bias_step": Kind(_step(places.SENSOR, "bias_step"), 0.6),
    "sensor drift": Kind(_drift(places.SENSOR), 0.5),
    "sensor lag": Kind(_lag(places.SENSOR, "lag"), 0.7),
    "sensor quantisation": Kind(_quantisation, 0.6),
    "sensor freeze": Kind(_freeze, 0.5),
    "sensor clip": Kind(_clip, 0.5),
    "data tuning": Kind(_tuning, 0.6),
    "data time_shift": Kind(_time_shift, 0.6),
}
MECHANICS = ("valve stiction karnopp", "valve stiction lugre")
