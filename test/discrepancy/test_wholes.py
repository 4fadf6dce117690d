"""Whole explanations: few effects before many, and a process that is a little off."""

import pytest
from gap_loops import loop, record, with_cause

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.discrepancy.answer.say import stem_sentences
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.process.change import changed_process
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Backlash, ExtraPole, HeStiction, ProcessGain, Saturation
from stiction_ros.loop import LoopModel

QUICK = GapOptions(quick=True)


def off(gain: float = 1.0, later: int = 0) -> LoopModel:
    """The loop's model as somebody fitted it: its gain and dead time a little off."""
    document = loop().to_mapping()
    output = document["process"]["outputs"][0]
    output["b"] = {"V1": [gain * b for b in output["b"]["V1"]]}
    output["delay"] = {"V1": output["delay"]["V1"] + later}
    return LoopModel.from_mapping(document)


@pytest.mark.trial
def test_a_stem_limit_behind_a_controller_that_winds_up_is_one_effect() -> None:
    model, recorded = with_cause("valve:V1", Saturation(0.0, 52.0), seed=5)
    answer = find_discrepancy(model, [recorded], QUICK)
    (effect,) = answer.effects
    assert (effect.place, effect.effect) == ("valve:V1", "saturation")
    assert effect.parameters["high"] == pytest.approx(52.0, abs=0.5)


def test_gain_and_dead_time_of_a_model_that_is_off_are_found() -> None:
    runs, _ = open_gate(off(1.08, 1), [record(loop(), seed=2)])
    changed = changed_process(off(1.08, 1), runs, ())
    assert changed is not None
    found = {change.what: change for change in changed.changes}
    assert found["gain"].value == pytest.approx(1.0 / 1.08, rel=0.02)
    low, high = found["delay"].interval
    assert low <= -1.0 <= high
    assert FreeRun(changed.bare, runs).model.valve_names == ("V1",)


def test_a_model_that_is_right_is_not_changed() -> None:
    answer = find_discrepancy(loop(), [record(loop(), seed=2)], QUICK)
    assert answer.process_changes == ()


@pytest.mark.trial
def test_friction_is_named_although_the_model_is_off() -> None:
    recorded = record(loop().with_effect("valve:V1", HeStiction(4.0, 1.5)), seed=2)
    answer = find_discrepancy(off(1.07, 1), [recorded], QUICK)
    effects = {e.effect: e for e in answer.effects}
    assert "stiction" in effects
    assert effects["stiction"].parameters["f_s"] == pytest.approx(4.0, abs=0.4)
    assert set(effects) <= {"stiction", "gain", "delay", "pole", "lag"}


def found(place: str) -> Discrepancy:
    model, recorded = with_cause(place, ExtraPole(8.0))
    return find_discrepancy(model, [recorded], QUICK)


@pytest.mark.trial
def test_what_closes_the_gap_says_so() -> None:
    model, recorded = with_cause("process:PV1", ProcessGain(1.3))
    (effect,) = find_discrepancy(model, [recorded], QUICK).effects
    assert effect.closed > 0.9
    assert "BIC" in effect.sentence


@pytest.mark.trial
def test_no_effect_is_both_named_and_untestable() -> None:
    answer = found("process:PV1")
    named = {(e.place, e.effect) for e in answer.effects} | set(answer.alternatives)
    assert not named & {(t.place, t.effect) for t in answer.untestable}


def test_a_recorded_stem_says_what_its_valve_does() -> None:
    recorded = record(loop().with_effect("valve:V1", Backlash(4.0)), stem=True)
    answer = find_discrepancy(loop(), [recorded], QUICK)
    (said,) = stem_sentences(answer.base_before.run, answer.looks[0].scores.fits)
    assert "backlash" in said.lower() or "stiction" in said.lower()
    assert said.endswith(("explains 99 % of that", "explains 100 % of that"))


@pytest.mark.trial
def test_a_stem_that_follows_points_behind_the_valve() -> None:
    recorded = record(loop().with_effect("process:PV1", ProcessGain(1.3)), stem=True)
    answer = find_discrepancy(loop(), [recorded], QUICK)
    assert "behind the valve" in answer.where[0]


def test_where_nothing_is_missed_no_place_is_told() -> None:
    answer = find_discrepancy(loop(), [record(loop(), seed=4, stem=True)], QUICK)
    assert answer.verdict is GapVerdict.NONE
    assert answer.where == ()
