"""The controller of a recorded run once more: every ``op``, every change of mode."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.controller.testing import ValveTestingController
from stiction_ros.online.input.op_port import Given
from stiction_ros.online.input.port import LONGEST_GAP
from stiction_ros.online.input.samples import Sample
from stiction_ros.online.input.signal_check import SignalCheck
from stiction_ros.online.loop_estimator import SECOND
from stiction_ros.online.replays.bag import ReplayBag
from stiction_ros.online.replays.result import Comparison
from stiction_ros.records.run.events import ModeChange, without_repeats


@dataclasses.dataclass(frozen=True)
class ReplayedControl:
    """What the controller did in the replay."""

    changes: tuple[ModeChange, ...]  # modes in their order, the one at the start first
    op: Comparison  # comparison with the recorded ``op``
    notes: tuple[str, ...]  # why it stopped or left something out


def replay_controller(
    bag: ReplayBag,
    settings: LiveControllerSettings,
    model: LoopModel,
    offers: tuple[tuple[str, int], ...],
    origin: int,
) -> ReplayedControl:
    """Step the controller over the recorded ``pv``, ``op_applied``, ``sp`` and ``dv``.

    Settings and model are those of the node. The ``offers`` are texts of loop models in order, each
    with the sample that it is for; ``origin`` is the stamp of sample 0 of the run, ns.
    """
    live = ValveTestingController(settings, model)
    recorded = _by_stamp(bag, "op", model.valve_names)
    step = round(model.sample_time * SECOND)
    notes: list[str] = []
    changes: list[ModeChange] = []
    replayed: dict[int, tuple[float, ...]] = {}
    first: int | None = None
    waiting = list(offers)
    for sample in _samples(bag, settings, model, notes):
        if first is None:
            first = (sample.stamp - origin + step // 2) // step
        now = first + sample.number
        while waiting and waiting[0][1] <= now:
            text, due = waiting.pop(0)
            try:
                live.offer(LoopModel.from_yaml(text, "loop_model"), due - first)
            except InputError as error:
                notes.append(f"the model for sample {due} is refused: {error}")
        told = len(live.changes) if changes else 0
        result = live.take(sample)
        if result is None:
            continue
        replayed[sample.stamp] = tuple(result.op.tolist())
        frictions = dict(live.known_friction())
        for change in live.changes[told:]:
            stamp = origin + (first + change.sample) * step
            changes.append(
                ModeChange(stamp, change.mode.value, change.model, change.reason, frictions)
            )
    own = {stamp: tuple(op.tolist()) for stamp, op in recorded.items() if stamp in replayed}
    op = Comparison.each(lambda at: f"op at {(at - origin) / SECOND:.9g} s", own, replayed)
    return ReplayedControl(without_repeats(changes), op, tuple(notes))


def _samples(
    bag: ReplayBag, settings: LiveControllerSettings, model: LoopModel, notes: list[str]
) -> Iterator[Sample]:
    """Yield every sample that has all the controller waits for, oldest first."""
    lockstep = settings.pace == "lockstep"
    pv = _by_stamp(bag, "pv", model.outputs)
    dv = _by_stamp(bag, "dv", model.process.measured_disturbances)
    op, given = _by_stamp(bag, "op", model.valve_names), _given(bag, model)
    if lockstep and settings.sp_source == "schedule":
        sp = _by_stamp(bag, "sp", model.outputs)
    else:
        sp = _held_set_points(bag, model.outputs)
    needs_dv = bool(model.process.measured_disturbances) and lockstep
    check = SignalCheck(model.instruments)
    missing = np.full(len(model.outputs), np.nan)
    step = round(model.sample_time * SECOND)
    stamps = sorted(pv) if lockstep else [s for s in sorted({*pv, *op}) if s >= min(op, default=0)]
    held_sp = held_dv = None
    number, before = -1, 0
    for stamp in stamps:
        answered = lockstep or stamp in op
        lacking = "sp" if answered and stamp not in sp else ""
        if lacking or (needs_dv and stamp not in dv):
            notes.append(
                f"{lacking or 'dv'} is missing at {stamp / SECOND:.9g} s, the replay ends there"
            )
            return
        if stamp in sp and check.within(sp[stamp]):
            held_sp = sp[stamp]
        held_dv = dv.get(stamp, held_dv)
        if held_sp is None:
            continue  # no set-point that can be used has come yet
        begins = number < 0
        gap = 0 if begins else min((stamp - before + step // 2) // step - 1, LONGEST_GAP)
        for _ in range(gap):
            number += 1
            told, before = given.get(before, Given()), before + step
            yield Sample(number, before, missing, held_sp, held_dv, False, False, told)
        number += 1
        told = given.get(stamp - step if begins else before, Given())
        shown = check.measured(stamp / SECOND, pv[stamp]) if stamp in pv else missing
        yield Sample(number, stamp, shown, held_sp, held_dv, answered, begins, told)
        before = stamp


def _by_stamp(bag: ReplayBag, kind: str, names: tuple[str, ...]) -> dict[int, FloatArray]:
    """Return the values of one signal by stamp; of several at one stamp the first."""
    found: dict[int, FloatArray] = {}
    for signal in bag.signals:
        if signal.kind == kind and signal.stamp not in found:
            values = signal.of(names)
            if values is not None:
                found[signal.stamp] = values
    return found


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


def _given(bag: ReplayBag, model: LoopModel) -> dict[int, Given]:
    """Return what the valves were given by stamp; of several at one stamp the first."""
    own = {"", bag.controller.node if bag.controller is not None else ""}
    found: dict[int, Given] = {}
    for signal in bag.signals:
        if signal.kind == "op_applied" and signal.stamp not in found:
            op = signal.of(model.valve_names)
            if op is not None:
                found[signal.stamp] = Given(op, ours=signal.by in own)
    return found
