"""The simulated plant: a loop model that moves one sample at a time."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects import Behaviour, DrivenByNoise, FloatArray, Memory
from stiction_ros.effects.disturbance.periodic import PeriodicDisturbance
from stiction_ros.loop.model import LoopModel
from stiction_ros.loop.valve_changes import ValveChange
from stiction_ros.processes import NoiseEntry


@dataclasses.dataclass(frozen=True)
class Measurement:
    """What the plant shows at one sample."""

    time: float  # seconds since the first sample
    pv: FloatArray  # measured outputs, shape (p,)
    pv_clean: FloatArray  # outputs without noise and sensor effects, shape (p,)
    dv: FloatArray  # measured disturbances in deviations from nominal, shape (d,)


class _Chain:
    """Effects in signal order with their memories; those that are random draw from ``random``."""

    def __init__(
        self, effects: tuple[Behaviour, ...], start: float, random: np.random.Generator
    ) -> None:
        self.effects = effects
        self.memories: list[Memory] = [effect.rest(start) for effect in effects]
        self._random = random

    def output_of(self, value: float, time: float) -> float:
        for i, effect in enumerate(self.effects):
            memory = self.memories[i]
            if isinstance(effect, DrivenByNoise):
                normal = float(self._random.standard_normal())
                self.memories[i], value = effect.step_with(memory, value, time, normal)
            else:
                self.memories[i], value = effect.step(memory, value, time)
        return value


class Plant:
    """Valves, process, sensors and noise of a :class:`LoopModel`, stepped by its user.

    Each sample is :meth:`measure`, then :meth:`apply` with the controller's OP (equations
    (1), (2) and (A.2)). The same model and seed give the same numbers, bit for bit, and the
    noise does not depend on what is applied.

    Args:
        model: the loop, at rest at its initial stem positions and outputs.
        seed: of the noise, 0 up.
        valve_changes: valves that change in mid-run, in the order of their times.

    Examples:
        >>> import numpy as np
        >>> from stiction_ros import LoopModel, Plant, find_config
        >>> plant = Plant(LoopModel.load(find_config("flow.loop.yaml")), seed=1)
        >>> plant.apply(np.array([51.0])).tolist()  # 3 % above the stem: within f_S, it stays
        [48.0]
        >>> plant.apply(np.array([53.0])).tolist()  # 5 % above: it slips, to f_D below OP
        [51.5]
    """

    def __init__(
        self, model: LoopModel, seed: int, valve_changes: Sequence[ValveChange] = ()
    ) -> None:
        """Start at rest at the model's initial stem positions and outputs."""
        self.model = model
        process = model.process
        self._random = np.random.default_rng(seed)
        self._random_effects = random_effects = np.random.default_rng([seed, 1])
        self._changes = list(valve_changes)
        self._limits = model.limits.tolist()
        self._valves = [
            _Chain(valve.effects, float(start), random_effects)
            for valve, start in zip(model.valves, model.stem_start, strict=True)
        ]
        self._sensors = [
            _Chain(effects, float(start), random_effects)
            for effects, start in zip(model.sensors, model.pv_start, strict=True)
        ]
        self._disturbances = [
            (d.place, _Chain((d.behaviour,), 0.0, random_effects))
            for d in model.disturbances
            if not d.load
        ]
        self._loads = [
            (model.valve_names.index(d.place), _Chain((d.behaviour,), 0.0, random_effects))
            for d in model.disturbances
            if d.load and not isinstance(d.behaviour, PeriodicDisturbance)
        ]
        self._waves = [  # go on between two samples, in which a process takes up their mean
            (model.valve_names.index(d.place), d.behaviour)
            for d in model.disturbances
            if d.load and isinstance(d.behaviour, PeriodicDisturbance)
        ]
        self._measurement_std = process.noise_std(NoiseEntry.MEASUREMENT)
        self._equation_std = process.noise_std(NoiseEntry.EQUATION)
        self._state = process.rest(model.stem_start, model.pv_start)
        self._stem = np.array(model.stem_start, dtype=float)
        self._measured = [process.upsets.index(n) for n in process.measured_disturbances]
        self.sample = 0
        self._now = self._look()

    def measure(self) -> Measurement:
        """Return the measurement of the present sample; calling again changes nothing."""
        return self._now

    def apply(self, op: FloatArray) -> FloatArray:
        """Hold ``op`` (m,), %, for one sample and return the stem positions (m,), %.

        OP and stems are kept within the valves' limits.
        """
        time = self._now.time
        while self._changes and self._changes[0].time <= time + 1e-9:
            change = self._changes.pop(0)
            j = self.model.valve_names.index(change.valve)
            self._valves[j] = _Chain(change.effects, float(self._stem[j]), self._random_effects)
        stem = np.empty(len(self._valves))
        for j, (chain, (low, high)) in enumerate(zip(self._valves, self._limits, strict=True)):
            asked = min(max(float(op[j]), low), high)
            stem[j] = min(max(chain.output_of(asked, time), low), high)
        noise = self._equation_std * self._random.standard_normal(len(self._equation_std))
        moved = stem.copy() if self._loads or self._waves else stem
        for j, chain in self._loads:
            moved[j] += chain.output_of(0.0, time)
        for j, wave in self._waves:
            moved[j] += float(wave.entering(np.array([time]), self.model.sample_time)[0])
        self._state = self.model.process.advance(self._state, moved, self._upset, noise)
        self._stem = stem
        self.sample += 1
        self._now = self._look()
        return stem

    def _look(self) -> Measurement:
        process = self.model.process
        time = self.sample * self.model.sample_time
        clean = process.output(self._state).astype(float, copy=True)
        self._upset = np.zeros(len(process.upsets))
        for place, chain in self._disturbances:
            value = chain.output_of(0.0, time)
            if place in process.outputs:
                clean[process.outputs.index(place)] += value
            else:
                self._upset[process.upsets.index(place)] += value
        pv = clean + self._measurement_std * self._random.standard_normal(len(clean))
        for i, chain in enumerate(self._sensors):
            if chain.effects:
                pv[i] = chain.output_of(float(pv[i]), time)
        return Measurement(time, pv, clean, self._upset[self._measured])
