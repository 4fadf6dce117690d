"""Loops in which an effect sets in half-way, and what the monitor makes of them."""

import dataclasses
import functools
from typing import ClassVar

import numpy as np

from stiction_ros.effects import Behaviour, ExtraDelay, Memory, StepDisturbance
from stiction_ros.loop import LoopModel, simulate_closed_loop
from stiction_ros.online.monitor.gap_finding import GapFinding, standing
from stiction_ros.online.monitor.gap_monitor import GapLook, GapMonitor, MonitorRule
from stiction_ros.records import Record
from stiction_studies.blind.loops.base_loops import base_loop
from stiction_studies.blind.loops.causes import CAUSES, Draw
from stiction_studies.blind.loops.circumstances import (
    drawn_noise,
    drawn_regime,
    drawn_set_points,
    pick,
    with_noise,
)
from stiction_studies.blind.loops.truth import Hidden, Regime, Truth
from stiction_studies.blind.scores.scoring import Score, score

SAMPLES, ONSET = 6000, 3000
# Process kinds by how often they are drawn; delays are put before a valve that is alone.
LATE_CAUSES = (
    *("valve stiction", "valve backlash", "valve slew", "valve lag", "valve saturation"),
    *("process delay", "disturbance step", "sensor bias_step", "sensor lag"),
)


@dataclasses.dataclass(frozen=True)
class Late(Behaviour):
    """A behaviour that does nothing before ``onset``, in s since the first sample."""

    effect: ClassVar[str] = "late"

    inner: Behaviour
    onset: float

    def rest(self, value: float) -> Memory:
        return self.inner.rest(value)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        if time < self.onset:
            return self.inner.rest(value), value
        return self.inner.step(memory, value, time)


@dataclasses.dataclass(frozen=True)
class LateLoop:
    """A loop with or without an effect from sample :data:`ONSET` on."""

    model: LoopModel  # what is known of it, without the effect
    record: Record  # OP and PV, :data:`SAMPLES` long
    truth: Truth  # what sets in; its times count from the first sample


@dataclasses.dataclass(frozen=True)
class Watched:
    """What the monitor made of a loop."""

    truth: Truth  # what sets in
    looks: tuple[int, int]  # measurements before the onset (all of a healthy loop), and behind it
    early: int  # measurements before the onset at which the gap counted as grown
    delay: int | None  # samples from the onset to the first alarm behind it; None without
    findings: tuple[GapFinding, ...]  # in order
    score: Score  # of the finding that stands; missed without alarm, quiet in a healthy loop


def late_loop(seed: int, *, healthy: bool = False) -> LateLoop:
    """Return a loop; the seed decides process, tuning, noise, set-points, effect and size.

    Args:
        seed: ≥ 0; seeds below 1000 are for tuning.
        healthy: nothing sets in.
    """
    random = np.random.default_rng([seed, 90])
    regime = dataclasses.replace(drawn_regime(random), half=False, excitation="moves")
    loop = base_loop(random, regime.process, tight=regime.tuning == "tight")
    sizes = drawn_noise(random, loop, regime)
    noisy = with_noise(loop.model, sizes, regime.noise)
    set_points = drawn_set_points(random, loop, regime, SAMPLES)
    simulation = int(random.integers(2**31))

    def run(model: LoopModel) -> Record:
        record = simulate_closed_loop(
            model, loop.controllers(), set_points, SAMPLES, simulation
        ).record
        return dataclasses.replace(record, stem=None)

    if healthy:
        return LateLoop(loop.model, run(noisy), Truth("single", seed, regime, "none", ()))
    single = len(loop.gains) == 1
    open_to = {c: 1.0 for c in LATE_CAUSES if single or c not in ("process delay", "valve lag")}
    name = pick(random, open_to)
    target = int(random.integers(len(loop.gains)))
    draw = Draw(random, loop, target, 1.0, float(sizes.white[target]), run(noisy))
    hidden = CAUSES[name].hide(draw)
    if isinstance(hidden.behaviour, StepDisturbance):
        at = ONSET * noisy.sample_time
        hidden = Hidden(hidden.place, dataclasses.replace(hidden.behaviour, onset=at))
    record = run(_from_onset(noisy, hidden, target))
    return LateLoop(loop.model, record, _truth(seed, regime, name, hidden))


def _truth(seed: int, regime: Regime, name: str, hidden: Hidden) -> Truth:
    return Truth("single", seed, regime, name, (hidden,))


def _from_onset(model: LoopModel, hidden: Hidden, target: int) -> LoopModel:
    """Return the plant with the effect from the onset on."""
    effect = hidden.behaviour
    if isinstance(effect, StepDisturbance):
        return model.with_effect(hidden.place, effect)
    late = Late(effect, ONSET * model.sample_time)
    if hidden.place.startswith("sensor:"):
        sensors = list(model.sensors)
        sensors[target] = (*sensors[target], late)
        return dataclasses.replace(model, sensors=tuple(sensors))
    assert hidden.place.startswith("valve:") or isinstance(effect, ExtraDelay)
    valves = list(model.valves)
    valves[target] = dataclasses.replace(valves[target], effects=(*valves[target].effects, late))
    return dataclasses.replace(model, valves=tuple(valves))


def watch(loop: LateLoop, rule: MonitorRule) -> Watched:
    """Run the monitor, and the workflow where it asks for it, over a loop."""
    record, onset = loop.record, ONSET if loop.truth.hidden else SAMPLES
    watched = record.name, record.valves, record.outputs, record.sample_time
    monitor = GapMonitor(rule, *watched, loop.model)
    looks: list[GapLook] = []
    findings: list[GapFinding] = []
    for k in range(len(record)):
        look = monitor.add(k, record.op[k], record.pv[k])
        looks += [] if look is None else [look]
        findings += monitor.collect()
    behind = [look for look in looks if look.end >= onset]
    first = next((look.end for look in behind if look.grown), None)
    return Watched(
        loop.truth,
        (len(looks) - len(behind), len(behind)),
        sum(look.grown for look in looks if look.end < onset),
        None if first is None else first - onset,
        tuple(findings),
        _judged(loop, findings),
    )


def _judged(loop: LateLoop, findings: list[GapFinding]) -> Score:
    if not findings:
        return Score.MISSED if loop.truth.hidden else Score.QUIET
    answer = dict(functools.reduce(standing, findings).document) | {"seconds": 0.0}
    return score(loop.truth, loop.model, answer, {}).score
