"""The experiment that would decide, simulated: what each of the rivals would show."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from stiction_ros.discrepancy.answer.found_effects import FoundEffect
from stiction_ros.discrepancy.answer.results import Discrepancy
from stiction_ros.effects import Behaviour, FloatArray, about, from_mapping
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, simulate_open_loop

HOLD, RAMP = 30, 60  # samples of each part of the moves of OP
TRAVEL = 10.0  # % that OP is moved at least
BANDS = 2.0  # times the friction that it is moved
MOST = 5  # rivals that are shown

Name = tuple[str, str]


@dataclasses.dataclass(frozen=True)
class Shown:
    """What one rival would show."""

    place: str  # place, effect: of the rival
    effect: str
    # stem, pv, true: stem in %, PV as its sensor shows it, and the output itself, shape (K,)
    stem: FloatArray
    pv: FloatArray
    true: FloatArray


@dataclasses.dataclass(frozen=True)
class Preview:
    """A simulated experiment: OP by hand up, back and in one step, without noise."""

    valve: str  # valve, output: that are moved and shown
    output: str
    op: FloatArray  # shape (K,), %
    sample_time: float  # s
    rivals: tuple[Shown, ...]  # at least two


def preview(found: Discrepancy) -> Preview | None:
    """Return the experiment for the first effect that is left in doubt; None without one."""
    rivals = _rivals(found)
    if len(rivals) < 2:
        return None
    model = _quiet(found.model_before)
    tags = {place.partition(":")[2] for place, _ in rivals}
    valve = next((v for v in model.valve_names if v in tags), model.valve_names[0])
    output = next((o for o in model.outputs if o in tags), model.outputs[0])
    j, i = model.valve_names.index(valve), model.outputs.index(output)
    op = _moves(model, j, rivals)
    shown = []
    for (place, effect), behaviour in rivals.items():
        values = behaviour.to_mapping()
        try:
            if "time" in values:  # inside the experiment
                behaviour = from_mapping(values | {"time": HOLD * model.sample_time})
            altered = model.with_effect(place, behaviour)
        except InputError:
            continue  # what changes the record alone has nothing to show in the plant
        run = simulate_open_loop(altered, op, 0)
        assert run.record.stem is not None
        signals = run.record.stem[:, j], run.record.pv[:, i], run.pv_clean[:, i]
        shown.append(Shown(place, effect, *signals))
    return Preview(valve, output, op[:, j], model.sample_time, tuple(shown))


def _rivals(found: Discrepancy) -> dict[Name, Behaviour]:
    for effect in found.effects:
        if not effect.alternatives:
            continue
        rivals: dict[Name, Behaviour] = {(effect.place, effect.effect): effect.behaviour}
        for key in effect.alternatives:
            rivals |= _fitted(found, key) or _alike(effect, key)
        if len(rivals) > 1:
            return dict(list(rivals.items())[:MOST])
    found_alone: dict[Name, Behaviour] = {}
    for key in found.alternatives:
        found_alone |= _fitted(found, key)
    return dict(list(found_alone.items())[:MOST])


def _fitted(found: Discrepancy, key: Name) -> dict[Name, Behaviour]:
    """Return a rival with the figures that fitted the record best, where it was tried."""
    tried = (fit for look in found.looks for fit in look.scores.fits if fit.candidate.key == key)
    best = max(tried, key=lambda fit: fit.delta_bic, default=None)
    return {key: best.behaviour} if best is not None and best.behaviour is not None else {}


def _alike(effect: FoundEffect, key: Name) -> dict[Name, Behaviour]:
    """Return a rival that no record tells from an effect, with the figures of that effect."""
    own = effect.parameters
    keys = [p.key for p in about(key[1]).parameters()]
    if any(each not in own for each in keys):
        return {}
    return {key: from_mapping({"effect": key[1]} | {each: own[each] for each in keys})}


def _moves(model: LoopModel, valve: int, rivals: Mapping[Name, Behaviour]) -> FloatArray:
    """Return OP by hand, shape (K, m): a hold, up, back, a step, and a hold."""
    friction = [
        float(v)
        for each in rivals.values()
        for key, v in each.to_mapping().items()
        if key in ("f_s", "band")
    ]
    travel = max([TRAVEL, *(BANDS * each for each in friction)])
    low, high = model.limits[valve].tolist()
    middle = float(model.op0[valve])
    up = np.linspace(0.0, travel, RAMP)
    path = np.concatenate([np.zeros(2 * HOLD), up, np.full(HOLD, travel), up[::-1], np.zeros(HOLD)])
    path = np.concatenate([path, np.full(2 * RAMP, travel)])
    op = np.tile(model.op0, (len(path), 1))
    op[:, valve] = np.clip(middle + path, low, high)
    return op


def _quiet(model: LoopModel) -> LoopModel:
    """Return the model without noise, at rest at its operating point."""
    document = model.to_mapping()
    for entry in document["process"].get("outputs", []):
        entry.pop("noise", None)
    document["disturbances"] = []
    document.pop("initial", None)
    return LoopModel.from_mapping(document, model.name)
