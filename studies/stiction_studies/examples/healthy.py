"""Friction-free loops that oscillate for another reason: three families, random by seed."""

import dataclasses
import math

import numpy as np
from scipy.signal import cont2discrete, lfilter

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions
from stiction_ros.loop import (
    LoopModel,
    Measurement,
    PiController,
    PiTuning,
    SetPoints,
    simulate_closed_loop,
)
from stiction_ros.records import Record
from stiction_studies.blind.pi_stability import largest_gains
from stiction_studies.examples.example import Example

FAMILIES = ("tight", "sine", "coloured")
MIDDLE = 50.0  # OP and PV of the operating point
_WIDE = (-1e9, 1e9)
_LEAD = 500  # samples until the start of a disturbance is forgotten


@dataclasses.dataclass(frozen=True)
class _Process:
    """A second-order process with dead time, times in samples."""

    gain: float
    time_constants: tuple[float, float]
    delay: int

    @classmethod
    def drawn(cls, random: np.random.Generator) -> "_Process":
        """Draw a gain of 0.2 to 5 of either sign, 4 to 40 samples, a delay of 1 to 8."""
        slow = float(random.uniform(4.0, 40.0))
        size = math.exp(random.uniform(math.log(0.2), math.log(5.0)))
        gain = float(random.choice((-1.0, 1.0))) * size
        return cls(
            gain, (slow, slow * float(random.uniform(0.05, 0.9))), int(random.integers(1, 9))
        )

    def coefficients(self) -> tuple[FloatArray, FloatArray]:
        """Return a₁ a₂ and b₁ b₂ of (8a) and (8b), zero-order hold."""
        slow, fast = self.time_constants
        system = ([self.gain], [slow * fast, slow + fast, 1.0])
        numerator, denominator, _ = cont2discrete(system, 1.0)
        return np.asarray(denominator[1:]), np.asarray(numerator[0, 1:])


class _Disturbed:
    """A controller whose measurement carries a given disturbance."""

    def __init__(self, controller: PiController, disturbance: FloatArray) -> None:
        self._controller, self._disturbance = controller, iter(disturbance.tolist())

    def __call__(self, measurement: Measurement, sp: FloatArray) -> FloatArray:
        pv = measurement.pv + next(self._disturbance)
        return self._controller(dataclasses.replace(measurement, pv=pv), sp)


def healthy_loop(seed: int, family: str = "tight") -> Example:
    """Return a loop with an ideal valve that oscillates.

    A second-order process with dead time under PI control; process, delay, tuning, sample
    time, set-point moves (or none), noise and 1000 to 2500 samples are drawn by ``seed``. The
    whole record is scaled such that OP has a standard deviation of 2 to 10 %. Orders and
    delay are left to the defaults of the identification.

    Args:
        seed: of everything.
        family: ``tight`` is tuned close to the limit of stability, with a white load that
            excites it; ``sine`` has a sine and ``coloured`` first-order autoregressive noise
            as a load or added to PV.

    Raises:
        InputError: unknown ``family``.
    """
    if family not in FAMILIES:
        raise InputError(
            f"unknown value {family!r}", where="family", fix=f"use {' or '.join(FAMILIES)}"
        )
    random = np.random.default_rng([seed, FAMILIES.index(family)])
    process = _Process.drawn(random)
    samples = int(random.integers(1000, 2501))
    sample_time = float(random.choice((1.0, 2.0, 5.0, 10.0, 30.0)))
    integral_time = process.time_constants[0] * float(random.uniform(0.6, 1.6))
    if family == "tight":
        decay = float(random.uniform(60.0, 400.0))
        gain = _gain(process, integral_time, math.exp(-1.0 / decay))
        noise = float(random.uniform(0.01, 0.1))
    else:
        gain = _gain(process, integral_time, 1.0) * float(random.uniform(0.15, 0.6))
        noise = float(random.uniform(0.02, 0.3))
    disturbance = _disturbance(random, family, process, samples)
    loop = _loop(process, PiTuning(gain, integral_time * sample_time), sample_time, noise)
    schedule = _set_points(random, samples, sample_time, abs(process.gain))
    record = _run(loop, schedule, disturbance, samples, int(random.integers(2**31)))
    record = _scaled(record, float(random.uniform(2.0, 10.0)))
    return Example("healthy", family, seed, record, loop, IdentificationOptions("exact"))


def _disturbance(
    random: np.random.Generator, family: str, process: _Process, samples: int
) -> FloatArray:
    """Return what is added to PV, shape (N,); its RMS is what 1 % of travel gives."""
    count = _LEAD + samples
    if family == "sine":
        period = math.exp(random.uniform(math.log(12.0), math.log(250.0)))
        phase = random.uniform(0.0, 2.0 * math.pi)
        wave = np.sin(2.0 * math.pi * np.arange(count) / period + phase)
    else:
        pole = float(random.uniform(0.8, 0.99)) if family == "coloured" else 0.0
        wave = np.asarray(lfilter([1.0], [1.0, -pole], random.standard_normal(count)))
    if family == "tight" or random.random() < 0.5:  # a load: it passes through the process
        a, b = process.coefficients()
        wave = np.asarray(lfilter([0.0, *b], [1.0, *a], wave))
    wave = wave[_LEAD:]
    return np.asarray(wave * abs(process.gain) / wave.std())


def _set_points(
    random: np.random.Generator, samples: int, sample_time: float, unit: float
) -> SetPoints:
    """Return a schedule with no move, or with three to eight of 0.3 to 2 % of travel in size."""
    count = 0 if random.random() < 0.3 else int(random.integers(3, 9))
    chosen = random.choice(np.arange(50, samples - 50), count, replace=False)
    times = np.concatenate([[0.0], np.sort(chosen) * sample_time])
    sizes = random.uniform(0.3, 2.0, count) * random.choice((-1.0, 1.0), count) * unit
    values = MIDDLE + np.concatenate([[0.0], sizes])
    return SetPoints(("PV1",), times, values[:, None])


def _loop(process: _Process, tuning: PiTuning, sample_time: float, noise: float) -> LoopModel:
    a, b = process.coefficients()
    output = {
        "name": "PV1",
        "a": a.tolist(),
        "b": {"V1": b.tolist()},
        "delay": {"V1": process.delay},
        "noise": {"std": noise * abs(process.gain)},
    }
    return LoopModel.from_mapping(
        {
            "loop": "healthy",
            "sample_time": sample_time,
            "valves": [{"name": "V1"}],
            "process": {"kind": "arx", "outputs": [output]},
            "operating_point": {"op": {"V1": MIDDLE}, "pv": {"PV1": MIDDLE}},
            "controller": {
                "kind": "pi",
                "gain": tuning.gain,
                "integral_time": tuning.integral_time,
            },
        }
    )


def _run(
    loop: LoopModel, schedule: SetPoints, disturbance: FloatArray, samples: int, seed: int
) -> Record:
    assert loop.controller is not None
    controller = PiController(loop.controller, loop.sample_time, MIDDLE, _WIDE)
    run = simulate_closed_loop(loop, _Disturbed(controller, disturbance), schedule, samples, seed)
    return dataclasses.replace(run.record, pv=run.record.pv + disturbance[:, None])


def _scaled(record: Record, spread: float) -> Record:
    """Return the record with all deviations scaled for a standard deviation of OP, %.

    The loop is linear and nothing limits OP, so this is the same loop with larger or smaller
    noise, disturbance and set-point moves.
    """
    factor = spread / float(record.op.std())

    def scaled(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else MIDDLE + factor * (values - MIDDLE)

    assert record.sp is not None
    return dataclasses.replace(
        record,
        op=MIDDLE + factor * (record.op - MIDDLE),
        pv=MIDDLE + factor * (record.pv - MIDDLE),
        sp=scaled(record.sp),
        stem=scaled(record.stem),
    )


def _gain(process: _Process, integral_time: float, radius: float) -> float:
    """Return the largest PI gain whose closed-loop poles stay within ``radius``."""
    loop = _loop(process, PiTuning(1.0, integral_time), 1.0, 0.0)
    first = np.array([math.copysign(0.1 / abs(process.gain), process.gain)])
    linear = loop.process.linear(1.0)
    return float(largest_gains(linear, np.array([integral_time]), radius, first)[0])
