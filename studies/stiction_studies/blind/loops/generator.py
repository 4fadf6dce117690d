"""Blind loops: what the workflow sees, and the answer that it does not."""

import dataclasses
from pathlib import Path

import numpy as np

from stiction_ros.effects import (
    Behaviour,
    Freeze,
    SineDisturbance,
    StepDisturbance,
    TimeShift,
    Tuning,
)
from stiction_ros.errors import InputError, storing
from stiction_ros.loop import LoopModel, PiTuning, SetPoints, simulate_closed_loop
from stiction_ros.records import Record
from stiction_ros.records.csv_writer import write_csv
from stiction_ros.texts import json_text
from stiction_studies.blind.loops.base_loops import BaseLoop, base_loop
from stiction_studies.blind.loops.causes import CAUSES, FIRST_OF_TWO, SECOND_OF_TWO, Cause, Draw
from stiction_studies.blind.loops.circumstances import (
    drawn_noise,
    drawn_regime,
    drawn_set_points,
    pick,
    with_noise,
)
from stiction_studies.blind.loops.outside import ageing_tank, changing_gain
from stiction_studies.blind.loops.truth import FAMILIES, Hidden, Regime, Truth

LEAD = 200  # samples before the record begins
SAMPLES = (1200, 2000)
HEALTHY = 0.2  # of single loops


@dataclasses.dataclass(frozen=True)
class BlindLoop:
    """What the workflow sees of a loop."""

    # the current model, which lacks what is hidden; it knows the process, and in a loop of one
    # valve the recorded tuning
    model: LoopModel
    record: Record  # OP, PV and SP; no stem


@dataclasses.dataclass(frozen=True)
class _Scene:
    """A healthy loop with its noise, set-points and the seed of its simulation."""

    loop: BaseLoop
    noisy: LoopModel
    white: np.ndarray[tuple[int], np.dtype[np.float64]]
    set_points: SetPoints
    samples: int
    seed: int

    def run(self, model: LoopModel, tunings: tuple[PiTuning, ...]) -> Record:
        """Return the record after the lead, its time from zero, without stems."""
        controllers = self.loop.with_tunings(tunings).controllers()
        count = LEAD + self.samples
        run = simulate_closed_loop(model, controllers, self.set_points, count, self.seed)
        record = run.record.part(LEAD, count)
        return dataclasses.replace(record, name="blind", stem=None, start=0.0)


def blind_loop(seed: int, family: str = "single") -> tuple[BlindLoop, Truth]:
    """Return a loop with something hidden in it, and the answer.

    The seed decides everything: process, tuning, noise, set-points, effect and size.

    Args:
        seed: ≥ 0.
        family: ``single`` (one effect, or none in a fifth of the loops), ``two`` effects, or
            ``outside`` the catalogue.

    Raises:
        InputError: unknown family or negative seed.
    """
    if family not in FAMILIES:
        raise InputError(
            f"unknown value {family!r}", where="family", fix=f"use {' | '.join(FAMILIES)}"
        )
    if seed < 0:
        raise InputError(f"{seed} is negative", where="seed")
    random = np.random.default_rng([seed, FAMILIES.index(family)])
    return {"single": _single, "two": _two, "outside": _outside}[family](random, seed)


def _single(random: np.random.Generator, seed: int) -> tuple[BlindLoop, Truth]:
    regime = drawn_regime(random)
    if random.random() < HEALTHY:
        regime = dataclasses.replace(regime, half=False)
        scene = _scene(random, regime)
        truth = Truth("single", seed, regime, "none", ())
        return _recorded(scene, ()), truth
    open_to = {
        name: cause.weight
        for name, cause in CAUSES.items()
        if not cause.processes or regime.process in cause.processes
    }
    name = pick(random, open_to)
    scene = _scene(random, regime)
    target = int(random.integers(len(scene.loop.gains)))
    hidden = (_hide(CAUSES[name], random, scene, target, regime),)
    return _recorded(scene, hidden), Truth("single", seed, regime, name, hidden)


def _two(random: np.random.Generator, seed: int) -> tuple[BlindLoop, Truth]:
    regime = dataclasses.replace(drawn_regime(random), half=False, excitation="moves")
    names = (str(random.choice(FIRST_OF_TWO)), str(random.choice(SECOND_OF_TWO)))
    scene = _scene(random, regime)
    target = int(random.integers(len(scene.loop.gains)))
    hidden = tuple(_hide(CAUSES[name], random, scene, target, regime) for name in names)
    return _recorded(scene, hidden), Truth("two", seed, regime, " + ".join(names), hidden)


def _outside(random: np.random.Generator, seed: int) -> tuple[BlindLoop, Truth]:
    regime = dataclasses.replace(drawn_regime(random), half=False, excitation="moves")
    tank = bool(random.random() < 0.4)
    if tank or regime.process == "tank":
        regime = dataclasses.replace(regime, process="tank")
    scene = _scene(random, regime)
    change = (ageing_tank if regime.process == "tank" else changing_gain)(
        random, scene.noisy.process, scene.samples + LEAD
    )
    model = dataclasses.replace(scene.noisy, process=change.process)
    record = scene.run(model, scene.loop.tunings)
    truth = Truth("outside", seed, regime, change.name, (), change.name)
    return BlindLoop(_known(scene.loop), record), truth


def _scene(random: np.random.Generator, regime: Regime) -> _Scene:
    loop = base_loop(random, regime.process, tight=regime.tuning == "tight")
    sizes = drawn_noise(random, loop, regime)
    samples = int(random.integers(SAMPLES[0], SAMPLES[1] + 1))
    set_points = drawn_set_points(random, loop, regime, LEAD + samples)
    noisy = with_noise(loop.model, sizes, regime.noise)
    return _Scene(loop, noisy, sizes.white, set_points, samples, int(random.integers(2**31)))


def _hide(
    cause: Cause, random: np.random.Generator, scene: _Scene, target: int, regime: Regime
) -> Hidden:
    reference = scene.run(scene.noisy, scene.loop.tunings)
    scale = 0.5 if regime.half else 1.0
    return cause.hide(
        Draw(random, scene.loop, target, scale, float(scene.white[target]), reference)
    )


def _recorded(scene: _Scene, hidden: tuple[Hidden, ...]) -> BlindLoop:
    """Return what is seen of the loop with the hidden effects."""
    model, tunings = scene.noisy, list(scene.loop.tunings)
    lead = LEAD * model.sample_time
    for entry in hidden:
        behaviour = entry.behaviour
        if isinstance(behaviour, Tuning):
            tunings[0] = PiTuning(behaviour.gain, behaviour.integral_time)
        elif not isinstance(behaviour, TimeShift):
            model = model.with_effect(entry.place, _later(behaviour, lead))
    record = scene.run(model, tuple(tunings))
    for entry in hidden:
        if isinstance(entry.behaviour, TimeShift):
            late = [entry.behaviour.simulate(column) for column in record.pv.T]
            record = dataclasses.replace(record, pv=np.column_stack(late))
    return BlindLoop(_known(scene.loop), record)


def _later(behaviour: Behaviour, lead: float) -> Behaviour:
    """Return the behaviour with times that count from ``lead`` seconds before the record."""
    if isinstance(behaviour, SineDisturbance):
        turned = behaviour.phase - 2.0 * np.pi * lead / behaviour.period
        return dataclasses.replace(behaviour, phase=float(turned))
    if isinstance(behaviour, StepDisturbance | Freeze):
        return dataclasses.replace(behaviour, onset=behaviour.onset + lead)
    return behaviour


def _known(loop: BaseLoop) -> LoopModel:
    """Return the current model: with the recorded tuning where one PI controller is all."""
    if len(loop.tunings) > 1:
        return loop.model
    document = loop.model.to_mapping()
    tuning = loop.tunings[0]
    document["controller"] = {
        "kind": "pi",
        "gain": tuning.gain,
        "integral_time": tuning.integral_time,
    }
    return LoopModel.from_mapping(document, loop.model.name)


def write_blind_loop(seed: int, family: str, folder: Path, answers: Path) -> None:
    """Write ``record.csv`` and ``model.loop.yaml`` to ``folder``, the answer to ``answers``.

    Both folders are made where they are missing; the answer is ``FAMILY_SEED.json``.

    Raises:
        InputError: as :func:`blind_loop`; a folder that cannot be written.
    """
    seen, truth = blind_loop(seed, family)
    with storing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        answers.mkdir(parents=True, exist_ok=True)
        write_csv(seen.record, folder / "record.csv")
        seen.model.save(folder / "model.loop.yaml")
        answer = answers / f"{family}_{seed}.json"
        answer.write_text(json_text(truth.to_mapping()) + "\n", encoding="utf-8")
