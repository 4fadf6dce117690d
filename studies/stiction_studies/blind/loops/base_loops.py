"""Healthy loops of several processes under PI control, random by seed."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.signal import cont2discrete

from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel, PiController, PiTuning
from stiction_studies.blind.pi_controllers import PiControllers
from stiction_studies.blind.pi_stability import largest_gains

MIDDLE = 50.0  # OP and PV of the operating point
LIMITS = (0.0, 100.0)


@dataclasses.dataclass(frozen=True)
class BaseLoop:
    """A healthy loop; output i is controlled by valve i."""

    kind: str  # which of :data:`KINDS`
    model: LoopModel  # what is known of it, without noise, hidden effects or tuning
    tunings: tuple[PiTuning, ...]  # one PI controller per output
    gains: FloatArray  # units of PV per % of its own valve, shape (p,)
    slow: FloatArray  # dominant time constant of every output in samples, shape (p,)
    delays: FloatArray  # dead time from its own valve in samples, shape (p,)

    def with_tunings(self, tunings: tuple[PiTuning, ...]) -> "BaseLoop":
        """Return the same loop under other controllers."""
        return dataclasses.replace(self, tunings=tunings)

    def controllers(self) -> PiControllers:
        """Return its controllers, at rest where the loop begins."""
        model = self.model
        pairs = zip(self.tunings, model.stem_start.tolist(), strict=True)
        return PiControllers([PiController(t, model.sample_time, op, LIMITS) for t, op in pairs])


def base_loop(random: np.random.Generator, kind: str, *, tight: bool) -> BaseLoop:
    """Return a loop of one of the :data:`KINDS`.

    Args:
        random: source of chance.
        kind: of the process.
        tight: whether the loop is close to the limit of stability.
    """
    sample_time = 60.0 if kind == "tank" else float(random.choice((1.0, 2.0, 5.0, 10.0, 30.0)))
    loop = KINDS[kind](random, sample_time)
    if not tight:
        return loop
    radius = math.exp(-1.0 / float(random.uniform(40.0, 150.0)))
    integral_times = np.array([tuning.integral_time for tuning in loop.tunings])
    first = np.array([0.2 * tuning.gain for tuning in loop.tunings])
    linear = loop.model.process.linear(sample_time)
    gains = largest_gains(linear, integral_times / sample_time, radius, first)
    return loop.with_tunings(
        tuple(
            PiTuning(float(gain), float(integral_time))
            for gain, integral_time in zip(gains, integral_times, strict=True)
        )
    )


@dataclasses.dataclass(frozen=True)
class _Path:
    """From one valve to one output: gain, time constants and dead time in samples."""

    gain: float
    slow: float
    fast: float
    delay: int

    def tuning(self, random: np.random.Generator, sample_time: float) -> PiTuning:
        """Return a PI tuning by Skogestad's rules, closed loop as slow as drawn."""
        slow, dead = self.slow + 0.5 * self.fast, self.delay + 1.0 + 0.5 * self.fast
        wanted = max(dead, float(random.uniform(0.3, 0.8)) * min(self.slow, 40.0))
        integral = min(slow, 4.0 * (wanted + dead))
        return PiTuning(slow / (self.gain * (wanted + dead)), integral * sample_time)


def _single(path: _Path, random: np.random.Generator, sample_time: float, kind: str) -> BaseLoop:
    a, b = _coefficients(path.slow, path.fast)
    output = {
        "name": "PV1",
        "a": a.tolist(),
        "b": {"V1": (path.gain * b).tolist()},
        "delay": {"V1": path.delay},
    }
    model = _model([output], sample_time)
    tuning = path.tuning(random, sample_time)
    return BaseLoop(kind, model, (tuning,), *_scales([path]))


def _coefficients(slow: float, fast: float) -> tuple[FloatArray, FloatArray]:
    """Return a₁ … and b₁ … of (8a) and (8b) for a gain of one, zero-order hold."""
    denominator = [slow, 1.0] if fast == 0.0 else [slow * fast, slow + fast, 1.0]
    numerator, poles, _ = cont2discrete(([1.0], denominator), 1.0)
    return np.asarray(poles[1:]), np.asarray(numerator[0, 1:])


def _model(outputs: list[dict[str, Any]], sample_time: float) -> LoopModel:
    valves = [f"V{i + 1}" for i in range(len(outputs))]
    return LoopModel.from_mapping(
        {
            "loop": "blind",
            "sample_time": sample_time,
            "valves": [{"name": v, "limits": list(LIMITS), "effects": []} for v in valves],
            "process": {"kind": "arx", "outputs": outputs},
            "operating_point": {
                "op": dict.fromkeys(valves, MIDDLE),
                "pv": {str(output["name"]): MIDDLE for output in outputs},
            },
        }
    )


def _scales(paths: list[_Path]) -> tuple[FloatArray, FloatArray, FloatArray]:
    gains = np.array([abs(path.gain) for path in paths])
    slow = np.array([path.slow for path in paths])
    return gains, slow, np.array([float(path.delay) for path in paths])


def _gain(random: np.random.Generator) -> float:
    size = math.exp(random.uniform(math.log(0.3), math.log(3.0)))
    return float(random.choice((-1.0, 1.0))) * size


def _first(random: np.random.Generator, sample_time: float) -> BaseLoop:
    path = _Path(_gain(random), float(random.uniform(5.0, 40.0)), 0.0, int(random.integers(1, 9)))
    return _single(path, random, sample_time, "first")


def _second(random: np.random.Generator, sample_time: float) -> BaseLoop:
    slow = float(random.uniform(5.0, 40.0))
    fast = slow * float(random.uniform(0.1, 0.8))
    path = _Path(_gain(random), slow, fast, int(random.integers(1, 9)))
    return _single(path, random, sample_time, "second")


def _late(random: np.random.Generator, sample_time: float) -> BaseLoop:
    path = _Path(_gain(random), float(random.uniform(6.0, 20.0)), 0.0, int(random.integers(9, 21)))
    return _single(path, random, sample_time, "late")


def _slow(random: np.random.Generator, sample_time: float) -> BaseLoop:
    slow = float(random.uniform(150.0, 400.0))
    path = _Path(4.0 * _gain(random), slow, 0.0, int(random.integers(1, 6)))
    return _single(path, random, sample_time, "slow")


def _coupled(random: np.random.Generator, sample_time: float) -> BaseLoop:
    own, outputs = [], []
    for i in range(2):
        slow = float(random.uniform(6.0, 30.0))
        fast = slow * float(random.uniform(0.1, 0.6))
        path = _Path(_gain(random), slow, fast, int(random.integers(1, 6)))
        other = path.gain * float(random.choice((-1.0, 1.0)) * random.uniform(0.15, 0.4))
        a, b = _coefficients(slow, fast)
        tags = (f"V{i + 1}", f"V{2 - i}")
        outputs.append(
            {
                "name": f"PV{i + 1}",
                "a": a.tolist(),
                "b": dict(zip(tags, ((path.gain * b).tolist(), (other * b).tolist()), strict=True)),
                "delay": dict(zip(tags, (path.delay, int(random.integers(1, 6))), strict=True)),
            }
        )
        own.append(path)
    tunings = tuple(_calmed(path.tuning(random, sample_time)) for path in own)
    return BaseLoop("coupled", _model(outputs, sample_time), tunings, *_scales(own))


def _calmed(tuning: PiTuning) -> PiTuning:
    """Return a tuning that leaves room for the other loop."""
    return PiTuning(0.6 * tuning.gain, 1.3 * tuning.integral_time)


def _tank(random: np.random.Generator, sample_time: float) -> BaseLoop:
    model = LoopModel.from_mapping(
        {
            "loop": "blind",
            "sample_time": sample_time,
            "valves": [{"name": v, "limits": list(LIMITS), "effects": []} for v in ("V1", "V2")],
            "process": {"kind": "stirred_tank", "outputs": [{"name": "C"}, {"name": "T"}]},
        }
    )
    gains = np.diag(model.process.linear(sample_time).gain)
    paths = [_Path(float(gain), 10.0, 0.0, 0) for gain in gains]
    tunings = tuple(_calmed(path.tuning(random, sample_time)) for path in paths)
    return BaseLoop("tank", model, tunings, *_scales(paths))


KINDS: dict[str, Callable[[np.random.Generator, float], BaseLoop]] = {
    "first": _first,
    "second": _second,
    "late": _late,
    "slow": _slow,
    "coupled": _coupled,
    "tank": _tank,
}
