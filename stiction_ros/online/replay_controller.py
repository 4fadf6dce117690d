"""The controller of a recorded run once more: every ``op``, every change of mode."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.live_controller import LiveController
from stiction_ros.online.node_settings import ControllerNodeSettings
from stiction_ros.online.replay_bag import ReplayBag
from stiction_ros.records.run_log import ModeChange

SECOND = 10**9


@dataclasses.dataclass(frozen=True)
class Offer:
    """A loop model for the controller: its YAML, and the sample of the run that it is for."""

    text: str
    sample: int


@dataclasses.dataclass(frozen=True)
class OpMatch:
    """How the recorded ``op`` and the replayed ones compare.

    Attributes:
        compared: samples at which both are there.
        equal: how many of them agree in every bit.
        first_difference: which sample differs first and how; empty when none does.
    """

    compared: int = 0
    equal: int = 0
    first_difference: str = ""


@dataclasses.dataclass(frozen=True)
class ReplayedControl:
    """What the controller did in the replay.

    Attributes:
        changes: modes in their order, the one at the start first.
        op: comparison with the recorded ``op``.
        notes: why it stopped or left something out.
    """

    changes: tuple[ModeChange, ...]
    op: OpMatch
    notes: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class _Inputs:
    """One sample as the controller got it."""

    stamp: int
    pv: FloatArray
    sp: FloatArray
    dv: FloatArray | None


def replay_controller(
    bag: ReplayBag,
    settings: ControllerNodeSettings,
    model: LoopModel,
    offers: tuple[Offer, ...],
    origin: int,
) -> ReplayedControl:
    """Step the controller over the recorded ``pv``, ``sp`` and ``dv``.

    Args:
        bag: the recorded run.
        settings, model: as the node had them.
        offers: loop models of the estimator in their order.
        origin: stamp of sample 0 of the run, ns.

    Raises:
        InputError: settings that do not fit the model.
    """
    live = LiveController(settings, model)
    recorded = _recorded_op(bag, model)
    step = round(model.sample_time * SECOND)
    notes: list[str] = []
    changes: list[ModeChange] = []
    match = OpMatch()
    first: int | None = None
    waiting = list(offers)
    for sample in _samples(bag, settings, model, notes):
        if first is None:
            first = (sample.stamp - origin + step // 2) // step
        now = (sample.stamp - origin + step // 2) // step
        while waiting and waiting[0].sample <= now:
            _offer(live, waiting.pop(0), first, notes)
        told = len(live.changes) if changes else 0
        op = live.step(sample.pv, sample.sp, sample.dv).op
        match = _compared(match, op, recorded.get(sample.stamp), (sample.stamp - origin) / SECOND)
        frictions = dict(live.known_friction())
        for change in live.changes[told:]:
            stamp = origin + (first + change.sample) * step
            changes.append(
                ModeChange(stamp, change.mode.value, change.model, change.reason, frictions)
            )
    return ReplayedControl(_without_repeats(changes), match, tuple(notes))


def _offer(live: LiveController, offer: Offer, first: int, notes: list[str]) -> None:
    try:
        live.offer(LoopModel.from_yaml(offer.text, "loop_model"), offer.sample - first)
    except InputError as error:
        notes.append(f"the model for sample {offer.sample} is refused: {error}")


def _samples(
    bag: ReplayBag, settings: ControllerNodeSettings, model: LoopModel, notes: list[str]
) -> Iterator[_Inputs]:
    """Yield every sample that has all the controller waits for, oldest first."""
    pv, dv, sp = _by_stamp(bag, "pv", model.outputs), _disturbances(bag, model), {}
    if settings.sp_source == "schedule":
        sp = _by_stamp(bag, "sp", model.outputs)
    else:
        sp = _held_set_points(bag, model.outputs)
    needs_dv = bool(model.process.measured_disturbances) and settings.pace == "lockstep"
    for stamp in sorted(pv):
        if stamp not in sp or (needs_dv and stamp not in dv):
            missing = "sp" if stamp not in sp else "dv"
            notes.append(f"{missing} is missing at {stamp / SECOND:.9g} s, the replay ends there")
            return
        yield _Inputs(stamp, pv[stamp], sp[stamp], dv.get(stamp))


def _by_stamp(bag: ReplayBag, kind: str, names: tuple[str, ...]) -> dict[int, FloatArray]:
    """Return the values of one signal by stamp; of several at one stamp the first."""
    found: dict[int, FloatArray] = {}
    for signal in bag.signals:
        if signal.kind == kind and signal.stamp not in found:
            values = signal.of(names)
            if values is not None:
                found[signal.stamp] = values
    return found


def _disturbances(bag: ReplayBag, model: LoopModel) -> Mapping[int, FloatArray]:
    return _by_stamp(bag, "dv", model.process.measured_disturbances)


def _held_set_points(bag: ReplayBag, names: tuple[str, ...]) -> dict[int, FloatArray]:
    """Return the set-points recorded last before the ``op`` of each stamp."""
    found: dict[int, FloatArray] = {}
    held: FloatArray | None = None
    for signal in bag.signals:
        if signal.kind == "sp":
            values = signal.of(names)
            held = held if values is None else values
        elif signal.kind == "op" and held is not None:
            found.setdefault(signal.stamp, held)
    return found


def _recorded_op(bag: ReplayBag, model: LoopModel) -> dict[int, FloatArray]:
    return _by_stamp(bag, "op", model.valve_names)


def _compared(match: OpMatch, op: FloatArray, recorded: FloatArray | None, time: float) -> OpMatch:
    if recorded is None:
        return match
    same = np.array_equal(op, recorded)
    difference = match.first_difference
    if not same and not difference:
        difference = f"op at {time:.9g} s: recorded {recorded.tolist()}, replayed {op.tolist()}"
    return OpMatch(match.compared + 1, match.equal + same, difference)


def _without_repeats(changes: list[ModeChange]) -> tuple[ModeChange, ...]:
    """Drop changes that change neither mode nor model nor friction, as their readers do."""
    kept: list[ModeChange] = []
    for change in changes:
        force = (change.mode, change.model, change.frictions)
        if not kept or force != (kept[-1].mode, kept[-1].model, kept[-1].frictions):
            kept.append(change)
    return tuple(kept)
