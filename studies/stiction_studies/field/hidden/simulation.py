"""A loop with what is hidden in it, put together and run."""

import dataclasses
import math
from collections.abc import Iterable

import numpy as np
from scipy.signal import lfilter

from stiction_studies.field import loads
from stiction_studies.field.hidden import kernels
from stiction_studies.field.hidden.effect import ADDED, LOAD, OUTPUT, PROCESS, SENSOR, VALVE, Effect
from stiction_studies.field.hidden.plants import FINE, Plant
from stiction_studies.field.hidden.tuning import Tuning
from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.valves import Law, Stem, Valve

AT_REST = 50.0  # OP and PV about which a loop works
OP_LIMITS = (0.0, 100.0)
LEAD = 300  # samples before the record begins
FAR = 1e9

# of a characteristic, by its law
CURVES = {"": kernels.EXPONENTIAL, "quadratic": kernels.QUADRATIC, "in a line": kernels.IN_A_LINE}


@dataclasses.dataclass(frozen=True)
class Signals:
    """What acts on a loop from outside at each sample, the lead included, shape (K,) each."""

    set_point: FloatArray  # engineering units
    output: FloatArray  # what adds to the output, the noise of the process
    reading: FloatArray  # what adds to the transmitter's reading, its noise
    by_hand: FloatArray  # OP where the loop is in manual, %; NaN elsewhere

    def __len__(self) -> int:
        return len(self.set_point)


@dataclasses.dataclass(frozen=True)
class Base:
    """A healthy loop."""

    plant: Plant  # in continuous time
    tuning: Tuning  # of its PI controller
    sample_time: float  # s
    scan: int  # samples of a scan
    winding: bool  # whether the integral part goes on at the limits of OP


@dataclasses.dataclass(frozen=True)
class Run:
    """What happened at each sample, the lead included, shape (K,) each."""

    op: FloatArray  # %
    pv: FloatArray  # as read, engineering units
    stem: FloatArray  # where it stands at the end of the sample, %
    clean: FloatArray  # output before the sensor


def run(base: Base, signals: Signals, effects: Iterable[Effect] = ()) -> Run:
    """Run a loop from rest at :data:`AT_REST`."""
    effects = tuple(effects)
    tuning = base.tuning
    for effect in effects:
        if effect.name == "tuning":
            tuning = Tuning(effect.figures["gain"], effect.figures["integral_time"])
    plant = altered(base.plant, effects, base.sample_time)
    a, b, c = plant.stepped(base.sample_time / FINE)
    law, friction = _friction(effects, base.sample_time)
    stem = np.zeros(4)
    stem[0] = stem[3] = AT_REST
    form = kernels.WINDING_UP if base.winding else kernels.VELOCITY
    controller = [tuning.gain, tuning.integral_time, *OP_LIMITS, form, base.scan]
    output, reading, load = _added(effects, signals, base.sample_time)
    rows = np.stack(
        [
            signals.set_point,
            signals.output + output,
            signals.reading + reading,
            np.isfinite(signals.by_hand).astype(np.float64),
            np.nan_to_num(signals.by_hand),
        ]
    )
    out = kernels.run_hidden(
        (law, friction, stem, _chain(effects)),
        (a, b, c, plant.fine_dead_time(base.sample_time), np.zeros(len(b))),
        _sensor(effects, base.sample_time),
        np.array([*map(float, controller), base.sample_time, AT_REST, AT_REST]),
        rows,
        load,
    )
    return Run(*out)


def altered(plant: Plant, effects: Iterable[Effect], sample_time: float) -> Plant:
    """Return the plant with the effects that act on it."""
    for effect in effects:
        if effect.place != PROCESS:
            continue
        figures = effect.figures
        if effect.name == "gain":
            plant = dataclasses.replace(plant, gain=figures["factor"] * plant.gain)
        elif effect.name == "pole":
            plant = dataclasses.replace(plant, lags=(*plant.lags, figures["tau"]))
        elif effect.name == "delay":
            extra = figures["extra"] * sample_time
            plant = dataclasses.replace(plant, dead_time=plant.dead_time + extra)
        else:
            plant = dataclasses.replace(plant, decay=figures["rate"])
    return plant


def _friction(effects: Iterable[Effect], sample_time: float) -> tuple[int, FloatArray]:
    """Return the law of friction and its parameters."""
    for effect in effects:
        figures = effect.figures
        if effect.name == "backlash":
            half = 0.5 * figures["band"]
            return Law.BACKLASH.value, Valve(Law.BACKLASH, half, half).parameters()
        if effect.name == "stiction" and not effect.mechanical:
            return Law.HE.value, Valve(Law.HE, figures["f_s"], figures["f_d"]).parameters()
        if effect.name == "stiction":
            stem = Stem(
                natural=figures["natural"] * sample_time,
                damping=figures["damping"],
                lag=figures["lag"] * sample_time,
                stribeck=figures["stribeck"] / sample_time,
            )
            valve = Valve(Law[effect.law.upper()], figures["static"], figures["sliding"], stem)
            return valve.law.value, valve.parameters()
    return kernels.NO_FRICTION, np.zeros(1)


def _chain(effects: Iterable[Effect]) -> FloatArray:
    """Return what follows the stem's friction, as the kernel takes it."""
    slew, lag, low, high, kind, curve, offset = FAR, 0.0, -FAR, FAR, kernels.SMOOTH, 0.0, 0.0
    for effect in effects:
        if effect.place != VALVE:
            continue
        figures = effect.figures
        if effect.name == "slew":
            slew = figures["rate"]
        elif effect.name == "lag":
            lag = figures["tau"]
        elif effect.name == "saturation":
            low, high = figures["low"], figures["high"]
        elif effect.name == "characteristic":
            curve = figures["curve"]
            kind = CURVES[effect.law]
        elif effect.name == "offset":
            offset = figures["size"]
    return np.array([slew, lag, low, high, float(kind), curve, offset])


def _sensor(effects: Iterable[Effect], sample_time: float) -> FloatArray:
    lag, low, high, frozen, thawed, quantum = 0.0, -FAR, FAR, -1.0, -1.0, 0.0
    for effect in effects:
        if effect.place != SENSOR:
            continue
        figures = effect.figures
        if effect.name == "lag":
            lag = figures["tau"]
        elif effect.name == "clip":
            low, high = figures["low"], figures["high"]
        elif effect.name == "quantisation":
            quantum = figures["step"]
        elif effect.name == "freeze":
            frozen = LEAD + round(figures["time"] / sample_time)
            thawed = frozen + round(figures["duration"] / sample_time)
    return np.array([lag, low, high, frozen, thawed, quantum])


def _added(
    effects: Iterable[Effect], signals: Signals, sample_time: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what effects add to the output and the reading, and to the stem at fine steps."""
    count = len(signals)
    samples: FloatArray = (np.arange(count, dtype=np.float64) - LEAD) * sample_time
    fine: FloatArray = (np.arange(count * FINE, dtype=np.float64) / FINE - LEAD) * sample_time
    output, reading, load = np.zeros(count), np.zeros(count), np.zeros(count * FINE)
    for effect in effects:
        if effect.place == OUTPUT:
            output += shape(effect, samples, sample_time)
        elif effect.place == SENSOR and effect.name in ADDED:
            reading += shape(effect, samples, sample_time)
        elif effect.place == LOAD:
            load += shape(effect, fine, sample_time)
    return output, reading, load


def shape(effect: Effect, time: FloatArray, sample_time: float) -> FloatArray:
    """Return what an effect adds at some times, s since the first sample, shape (K,).

    Random ones come from their figure ``seed`` and are held for a sample each.
    """
    figures = effect.figures
    if effect.name in ("step", "bias_step"):
        return np.where(time >= figures["time"] - 1e-6 * sample_time, figures["size"], 0.0)
    if effect.name == "drift":
        return figures["rate"] * np.maximum(time, 0.0)
    if effect.name in ("sine", "square", "triangle"):
        kind = loads.Wave(effect.name)
        turn = figures["phase"] / (2.0 * math.pi)
        if kind is loads.Wave.TRIANGLE:  # as a sine it begins at zero, upwards
            turn += 0.25
        return figures["amplitude"] * loads.wave(kind, time, figures["period"], turn)
    random = np.random.default_rng(int(figures["seed"]))
    per_sample = round(sample_time / (time[1] - time[0]))
    white = random.standard_normal(len(time) // per_sample)
    if effect.name == "random_walk":
        walk = np.cumsum(np.where(time[::per_sample] >= 0.0, white, 0.0))
        values = figures["rate"] * math.sqrt(sample_time) * walk
    else:
        kept = math.exp(-sample_time / figures["tau"])
        values = lfilter([figures["std"] * math.sqrt(1.0 - kept**2)], [1.0, -kept], white)
    return np.repeat(values, per_sample)
