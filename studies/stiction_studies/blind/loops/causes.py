"""Effects that can be hidden, with sizes drawn above and around what matters in a plant."""

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np

from stiction_ros.effects import (
    Backlash,
    Behaviour,
    BiasStep,
    Characteristic,
    Clip,
    DriftDisturbance,
    ExtraDelay,
    ExtraPole,
    Freeze,
    HeStiction,
    Lag,
    Leak,
    ProcessGain,
    Quantisation,
    Saturation,
    SineDisturbance,
    Slew,
    StepDisturbance,
    TimeShift,
    Tuning,
)
from stiction_ros.records import Record
from stiction_studies.blind.loops.base_loops import BaseLoop
from stiction_studies.blind.loops.truth import Hidden

_LONGEST = 40.0  # samples, of a hidden lag


@dataclasses.dataclass(frozen=True)
class Draw:
    """From what the size of an effect is drawn."""

    random: np.random.Generator  # source of chance
    loop: BaseLoop  # the healthy loop
    target: int  # index of the output, and of its valve, that is hit
    scale: float  # 1, or 0.5 for effects of half the size
    noise: float  # standard deviation of the white noise on the output
    reference: Record  # the healthy loop's record under the same set-points and noise

    def within(self, low: float, high: float) -> float:
        """Return a number between the two, scaled."""
        return self.scale * float(self.random.uniform(low, high))

    def sign(self) -> float:
        """Return −1 or 1."""
        return float(self.random.choice((-1.0, 1.0)))

    @property
    def sample_time(self) -> float:
        """Seconds."""
        return self.loop.model.sample_time

    @property
    def seconds(self) -> float:
        """Length of the record."""
        return len(self.reference) * self.sample_time

    @property
    def unit(self) -> float:
        """Change of PV for one per cent of travel at rest."""
        return float(self.loop.gains[self.target])

    @functools.cached_property
    def op(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """OP of the healthy loop, shape (N,)."""
        return self.reference.op[:, self.target]

    @functools.cached_property
    def pv(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """PV of the healthy loop, shape (N,)."""
        return self.reference.pv[:, self.target]


def _stiction(draw: Draw) -> Behaviour:
    static = draw.within(2.0, 8.0)
    return HeStiction(static, static * float(draw.random.uniform(0.1, 0.75)))


def _backlash(draw: Draw) -> Behaviour:
    return Backlash(draw.within(3.0, 12.0))


def _slew(draw: Draw) -> Behaviour:
    """A rate at which the largest moves of OP take 6 to 25 samples (half size: 3 to 12)."""
    largest = float(np.quantile(np.abs(draw.op[5:] - draw.op[:-5]), 0.995))
    return Slew(max(largest, 0.2) / draw.within(6.0, 25.0) / draw.sample_time)


def _time_constant(draw: Draw) -> float:
    slow = min(float(draw.loop.slow[draw.target] + draw.loop.delays[draw.target]), _LONGEST)
    return draw.within(0.4, 1.2) * slow * draw.sample_time


def _valve_lag(draw: Draw) -> Behaviour:
    return Lag(_time_constant(draw))


def _pole(draw: Draw) -> Behaviour:
    return ExtraPole(_time_constant(draw))


def _sensor_lag(draw: Draw) -> Behaviour:
    return Lag(_time_constant(draw))


def _saturation(draw: Draw) -> Behaviour:
    """Cuts off 10 to 30 % of the time of the healthy loop's OP (half size: 5 to 15 %)."""
    share = draw.within(0.1, 0.3)
    if draw.random.random() < 0.5:
        return Saturation(0.0, float(np.quantile(draw.op, 1.0 - share)))
    return Saturation(float(np.quantile(draw.op, share)), 100.0)


def _characteristic(draw: Draw) -> Behaviour:
    return Characteristic(draw.sign() * draw.within(1.0, 3.0))


def _gain(draw: Draw) -> Behaviour:
    return ProcessGain(math.exp(draw.sign() * draw.within(0.25, 0.6)))


def _delay(draw: Draw) -> Behaviour:
    return ExtraDelay(float(max(round(draw.within(2.0, 8.0)), 1)))


def _leak(draw: Draw) -> Behaviour:
    return Leak(draw.scale / (float(draw.random.uniform(40.0, 150.0)) * draw.sample_time))


def _onset(draw: Draw) -> float:
    count = len(draw.reference)
    return round(float(draw.random.uniform(0.2, 0.8)) * count) * draw.sample_time


def _jump(draw: Draw) -> float:
    return draw.sign() * draw.within(1.5, 5.0) * draw.unit


def _step(draw: Draw) -> Behaviour:
    return StepDisturbance(_onset(draw), _jump(draw))


def _bias_step(draw: Draw) -> Behaviour:
    return BiasStep(_onset(draw), _jump(draw))


def _drift(draw: Draw) -> Behaviour:
    return DriftDisturbance(draw.sign() * draw.within(3.0, 8.0) * draw.unit / draw.seconds)


def _sine(draw: Draw) -> Behaviour:
    period = math.exp(draw.random.uniform(math.log(15.0), math.log(250.0)))
    phase = float(draw.random.uniform(0.0, 2.0 * math.pi))
    return SineDisturbance(draw.within(0.6, 2.5) * draw.unit, period * draw.sample_time, phase)


def _quantisation(draw: Draw) -> Behaviour:
    return Quantisation(draw.within(4.0, 12.0) * draw.noise)


def _freeze(draw: Draw) -> Behaviour:
    return Freeze(_onset(draw), draw.within(0.04, 0.15) * draw.seconds)


def _clip(draw: Draw) -> Behaviour:
    share, spread = draw.within(0.06, 0.2), float(np.ptp(draw.pv)) + 20.0 * draw.unit
    if draw.random.random() < 0.5:
        return Clip(float(draw.pv.min()) - spread, float(np.quantile(draw.pv, 1.0 - share)))
    return Clip(float(np.quantile(draw.pv, share)), float(draw.pv.max()) + spread)


def _tuning(draw: Draw) -> Behaviour:
    recorded = draw.loop.tunings[draw.target]
    weaker = math.exp(-draw.within(0.25, 0.9))
    if draw.random.random() < 0.5:
        return Tuning(recorded.gain * weaker, recorded.integral_time)
    return Tuning(recorded.gain, recorded.integral_time / weaker)


def _time_shift(draw: Draw) -> Behaviour:
    return TimeShift(float(max(round(draw.within(2.0, 6.0)), 1)))


@dataclasses.dataclass(frozen=True)
class Cause:
    """One cause: the kind of its place, how it is drawn, and how often."""

    place: str  # ``valve``, ``process``, ``disturbance``, ``sensor`` or ``data``
    draw: Callable[[Draw], Behaviour]  # returns the behaviour
    weight: float = 1.0  # among all causes
    processes: tuple[str, ...] = ()  # of the base loop; empty for all

    def hide(self, draw: Draw) -> Hidden:
        """Return the effect at the target of ``draw``."""
        model = draw.loop.model
        tag = (model.valve_names if self.place == "valve" else model.outputs)[draw.target]
        place = self.place if self.place == "data" else f"{self.place}:{tag}"
        return Hidden(place, self.draw(draw))


SINGLE_VALVE = ("first", "second", "late", "slow")
CAUSES: dict[str, Cause] = {
    "valve stiction": Cause("valve", _stiction, 3.0),
    "valve backlash": Cause("valve", _backlash, 2.0),
    "valve slew": Cause("valve", _slew, 2.0),
    "valve lag": Cause("valve", _valve_lag, 1.5),
    "valve saturation": Cause("valve", _saturation, 2.0),
    "valve characteristic": Cause("valve", _characteristic, 2.0),
    "process gain": Cause("process", _gain, 2.0),
    "process delay": Cause("process", _delay, 2.0),
    "process pole": Cause("process", _pole, 1.0),
    "process leak": Cause("process", _leak, 0.5, ("slow",)),
    "disturbance step": Cause("disturbance", _step, 1.5),
    "disturbance drift": Cause("disturbance", _drift, 1.5),
    "disturbance sine": Cause("disturbance", _sine, 2.0),
    "sensor bias_step": Cause("sensor", _bias_step, 0.75),
    "sensor drift": Cause("sensor", _drift, 0.75),
    "sensor lag": Cause("sensor", _sensor_lag, 1.0),
    "sensor quantisation": Cause("sensor", _quantisation, 0.5),
    "sensor freeze": Cause("sensor", _freeze, 0.5),
    "sensor clip": Cause("sensor", _clip, 0.5),
    "data tuning": Cause("data", _tuning, 0.75, SINGLE_VALVE),
    "data time_shift": Cause("data", _time_shift, 0.75, SINGLE_VALVE),
}
# Two at once that can be told apart: one from each list, of different traces.
FIRST_OF_TWO = (
    *("valve stiction", "valve backlash", "process gain", "process delay", "valve characteristic"),
)
SECOND_OF_TWO = ("disturbance step", "disturbance drift", "disturbance sine")
