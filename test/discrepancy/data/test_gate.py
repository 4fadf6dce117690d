"""What the recorded values show before any model is asked."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record, without_controller

from stiction_ros.discrepancy import GapOptions, find_discrepancy
from stiction_ros.discrepancy.data.controller_check import ControllerStatus, check_controller
from stiction_ros.discrepancy.data.gate import Gate, open_gate, quantum_of
from stiction_ros.discrepancy.simulation.free_run import Runs, join_records
from stiction_ros.effects import Behaviour, Clip, Freeze, Quantisation, TimeShift, Tuning
from stiction_ros.loop import PiTuning
from stiction_studies.blind.loops.generator import blind_loop


def opened(effect: Behaviour | None) -> tuple[Runs, Gate]:
    model = loop()
    true = model if effect is None else model.with_effect("sensor:PV1", effect)
    return open_gate(model, [record(true)])


def test_sound_data_show_nothing() -> None:
    assert opened(None)[1].findings == ()


@pytest.mark.parametrize(
    ("effect", "name"),
    [
        (Freeze(300.0, 60.0), "freeze"),
        (Clip(44.0, 56.0), "clip"),
        (Quantisation(0.5), "quantisation"),
    ],
)
def test_sensor_effects_are_seen_in_the_values(effect: Behaviour, name: str) -> None:
    assert [finding.effect for finding in opened(effect)[1].findings] == [name]


@pytest.mark.parametrize("effect", [Freeze(300.0, 60.0), Clip(44.0, 56.0), Quantisation(0.5)])
def test_what_the_model_has_already_is_no_finding(effect: Behaviour) -> None:
    model = loop().with_effect("sensor:PV1", effect)
    runs, gate = open_gate(model, [record(model)])
    plain, _ = opened(effect)
    assert gate.findings == ()
    # Its rows stay out of the scores all the same.
    assert runs.usable.tolist() == plain.usable.tolist()
    # Rounded values count as rounded, whoever named the rounding.
    assert runs.quanta == plain.quanta
    assert (runs.quanta == (0.5,)) == isinstance(effect, Quantisation)


@pytest.mark.parametrize(
    ("known", "true"),
    [
        (Freeze(100.0, 60.0), Freeze(300.0, 60.0)),
        (Clip(40.0, 60.0), Clip(44.0, 56.0)),
        (Quantisation(0.1), Quantisation(0.5)),
    ],
)
def test_what_the_model_has_with_other_figures_is_a_finding(
    known: Behaviour, true: Behaviour
) -> None:
    model = loop().with_effect("sensor:PV1", known)
    shown = record(loop().with_effect("sensor:PV1", true))
    found = open_gate(model, [shown])[1].findings
    assert [finding.effect for finding in found] == [true.effect]


def test_an_effect_of_the_gate_is_not_added_twice() -> None:
    model = loop().with_effect("sensor:PV1", Quantisation(0.5))
    found = find_discrepancy(model, [record(model)], GapOptions(quick=True))
    assert "quantisation" not in [effect.effect for effect in found.effects]
    assert found.model_after.to_mapping()["sensors"] == model.to_mapping()["sensors"]


def test_a_frozen_while_is_timed() -> None:
    (finding,) = opened(Freeze(300.0, 60.0))[1].findings
    behaviour = finding.behaviour
    assert isinstance(behaviour, Freeze)
    assert (behaviour.onset, behaviour.duration) == pytest.approx((300.0, 60.0), abs=1.0)


@pytest.mark.parametrize("leaps", [True, False])
def test_a_rest_at_the_end_of_all_values_was_frozen_where_it_leaps_away(leaps: bool) -> None:
    model, sound = loop(), record(loop())
    pv = sound.pv.copy()
    top = pv.max() + 0.5
    pv[260:300, 0] = np.linspace(pv[259, 0], top, 40)
    pv[300:340] = top
    if not leaps:
        pv[340:380, 0] = np.linspace(top, pv[380, 0], 41)[1:]
    runs, gate = open_gate(model, [dataclasses.replace(sound, pv=pv)])
    assert [finding.effect for finding in gate.findings] == ["freeze" if leaps else "clip"]
    assert not runs.usable[0, 302:338].any()


@pytest.mark.parametrize("rows", [slice(0, 50), slice(200, 250), slice(-50, None)])
def test_a_sensor_that_fails_to_its_end_was_frozen_wherever_in_the_record(rows: slice) -> None:
    model, sound = loop(), record(loop())
    pv = sound.pv.copy()
    pv[rows] = pv.max() + 5.0
    _, gate = open_gate(model, [dataclasses.replace(sound, pv=pv)])
    assert [finding.effect for finding in gate.findings] == ["freeze"]


@pytest.mark.parametrize("keeping", [0.5, 0.05])
def test_held_values_are_neither_clipped_nor_frozen_and_it_is_said(keeping: float) -> None:
    model, sound = loop(), record(loop())
    at, kept = np.arange(len(sound)), np.random.default_rng(1).random(len(sound)) < keeping
    kept[0] = True
    pv = sound.pv[np.maximum.accumulate(np.where(kept, at, 0))]
    runs, gate = open_gate(model, [dataclasses.replace(sound, pv=pv)])
    assert gate.findings == ()
    assert any("repeats itself" in note for note in gate.notes)
    assert runs.thinned[0] == pytest.approx(1.0 - keeping, abs=0.05)


def test_a_short_thinned_record_beside_a_long_one_counts_by_its_length() -> None:
    model, sound = loop(), record(loop())
    at, kept = np.arange(60), np.arange(60) % 3 == 0
    drawn = np.interp(at, at[kept], sound.pv[:60, 0][kept])[:, None]
    short = dataclasses.replace(sound.part(0, 60), pv=drawn)
    runs, _ = open_gate(model, [sound, short])
    assert runs.thinned[0] == pytest.approx(40 / (len(sound) + 60), rel=0.1)


def test_a_pv_that_never_moves_is_said() -> None:
    model, sound = loop(), record(loop())
    still = dataclasses.replace(sound, pv=np.full_like(sound.pv, 50.0))
    _, gate = open_gate(model, [still])
    assert "PV1 never moves: whatever OP does, it shows nothing" in gate.notes


def test_frozen_rows_are_not_scored() -> None:
    usable = opened(Freeze(300.0, 60.0))[0].usable
    assert not usable[0, 302:358].any()


def test_ends_of_a_sensor_are_found() -> None:
    (finding,) = opened(Clip(44.0, 56.0))[1].findings
    assert isinstance(finding.behaviour, Clip)
    assert finding.behaviour.high == 56.0


def test_a_quantum_is_the_least_distance() -> None:
    assert quantum_of(0.25 * np.round(np.random.default_rng(1).normal(0, 5, 300))) == 0.25


def test_continuous_values_have_no_quantum() -> None:
    assert quantum_of(np.random.default_rng(1).normal(0, 5, 300)) == 0.0


def test_the_recorded_tuning_is_recognised() -> None:
    check = check_controller(loop(), join_records(loop(), [record(loop())]))
    assert check.status is ControllerStatus.SAME


def test_another_tuning_is_named_with_its_figures() -> None:
    model = loop()
    other = dataclasses.replace(model, controller=PiTuning(1.1, 9.0))
    check = check_controller(model, join_records(model, [record(other)]))
    assert check.finding is not None
    assert isinstance(check.finding.behaviour, Tuning)
    assert check.finding.behaviour.gain == pytest.approx(1.1, rel=1e-3)


def test_another_tuning_is_told_by_the_values_that_a_historian_kept() -> None:
    model = loop()
    recorded = record(dataclasses.replace(model, controller=PiTuning(1.1, 9.0)))
    at, keeping = np.arange(len(recorded)), np.random.default_rng(1).random(len(recorded)) < 0.6
    keeping[0] = keeping[-1] = True
    pv = np.interp(at, at[keeping], recorded.pv[keeping, 0])[:, None]
    runs, _ = open_gate(model, [dataclasses.replace(recorded, pv=pv)])
    check = check_controller(model, runs)
    assert check.finding is not None
    assert isinstance(check.finding.behaviour, Tuning)
    assert check.finding.behaviour.gain == pytest.approx(1.1, rel=1e-3)
    assert check.finding.behaviour.integral_time == pytest.approx(9.0, rel=1e-3)
    assert check.left < 1e-3


@pytest.mark.parametrize(("step", "told"), [(0.05, True), (0.8, False)])
def test_rounding_leaves_what_rounding_leaves(step: float, told: bool) -> None:
    model = loop()
    recorded = record(dataclasses.replace(model, controller=PiTuning(1.1, 9.0)))
    pv = step * np.round(recorded.pv / step)
    runs, _ = open_gate(model, [dataclasses.replace(recorded, pv=pv)])
    check = check_controller(model, runs)
    assert (check.finding is not None) is told
    assert check.left > 0.02


@pytest.mark.parametrize("step", [0.05, 0.2])
def test_a_rounded_op_refutes_no_recorded_tuning(step: float) -> None:
    model = loop()
    moved = record(dataclasses.replace(model, controller=PiTuning(0.8, 12.0)), moves=False)
    coarse = dataclasses.replace(moved, op=step * np.rint(moved.op / step))
    check = check_controller(model, join_records(model, [coarse]))
    assert check.status is ControllerStatus.SAME


@pytest.mark.parametrize("known", [True, False])
def test_a_late_shortof_pv_is_named(known: bool) -> None:
    model = loop() if known else without_controller(loop())
    recorded = record(loop())
    late = TimeShift(4.0).simulate(recorded.pv[:, 0])[:, None]
    check = check_controller(model, join_records(model, [dataclasses.replace(recorded, pv=late)]))
    assert check.finding is not None
    assert check.finding.behaviour == TimeShift(4.0)


def test_op_of_an_operator_is_left_unexplained() -> None:
    recorded = record(loop())
    op = 50.0 + np.cumsum(np.random.default_rng(1).normal(0, 0.3, recorded.op.shape), axis=0)
    other = dataclasses.replace(recorded, op=np.clip(op, 5.0, 95.0))
    check = check_controller(loop(), join_records(loop(), [other]))
    assert check.status is ControllerStatus.UNEXPLAINED


@pytest.mark.parametrize(
    "kind",
    [
        "frozen",
        *(pytest.param(k, marks=pytest.mark.trial) for k in ("still", "two levels", "at its ends")),
    ],
)
def test_a_pv_that_shows_next_to_nothing_is_answered(kind: str) -> None:
    seen, _ = blind_loop(1)
    short = seen.record.part(0, 600)
    pv = short.pv.copy()
    if kind == "still":
        pv[:] = pv[0]
    elif kind == "two levels":
        pv = np.where(pv > np.median(pv), pv.max(), pv.min())
    elif kind == "frozen":
        pv[20:-20] = pv[20]
    else:
        pv = np.clip(pv, *np.quantile(pv, [0.45, 0.55]))
    answer = find_discrepancy(
        seen.model, [dataclasses.replace(short, pv=pv)], GapOptions(quick=True)
    )
    assert all(effect.place != "process:PV1" for effect in answer.effects)


@pytest.mark.trial
def test_samples_that_stand_alone_are_listed_as_not_searched() -> None:
    sound = record(loop(), seed=4)
    pv = sound.pv.copy()
    pv[100:600:50, 0] += 10.0
    answer = find_discrepancy(loop(), [dataclasses.replace(sound, pv=pv)], GapOptions(quick=True))
    assert answer.runs.alone == (10,)
    (told,) = [entry for entry in answer.not_considered if entry.effect == "spikes"]
    assert told.place == "sensor"
    assert told.reason.startswith("samples of PV1 that stand alone, 10 of them, were left out")
    assert told.to_dict() in answer.to_dict()["not_considered"]
    assert "spikes" not in {
        entry.effect
        for entry in find_discrepancy(loop(), [sound], GapOptions(quick=True)).not_considered
    }


def thinned(values: np.ndarray[tuple[int], np.dtype[np.float64]], digits: float) -> bool:
    """Tell whether the gate sees that values of a loop were thinned out."""
    model, recorded = loop(), record(loop())
    shown = np.round(values / digits) * digits
    kept = dataclasses.replace(recorded, pv=shown[: len(recorded), None])
    return open_gate(model, [kept])[0].thinned[0] > 0.0


@pytest.mark.parametrize("digits", [1e-12, 1e-4])
def test_values_between_kept_ones_are_seen_by_the_digits_of_the_record(digits: float) -> None:
    values = record(loop()).pv[:, 0]
    at = np.arange(len(values))
    keeping = np.random.default_rng(1).random(len(values)) < 0.6  # most lines span two samples
    keeping[0] = keeping[-1] = True
    drawn = np.interp(at, at[keeping], values[keeping])
    held = values[np.maximum.accumulate(np.where(keeping, at, 0))]
    assert not thinned(values, digits)
    assert thinned(drawn, digits)
    assert thinned(held, digits)


def test_values_on_a_coarse_lattice_or_at_an_end_are_not_thinned_out() -> None:
    values = record(loop()).pv[:, 0]
    assert not thinned(values, 0.1)
    assert not thinned(np.minimum(values, np.quantile(values, 0.8)), 1e-9)
