"""From a record to the name of what its simulation lacks."""

import numpy as np
import pytest
from gap_loops import loop, record, with_cause, without_set_points

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.effects import (
    Backlash,
    Behaviour,
    ExtraDelay,
    ExtraPole,
    HeStiction,
    Lag,
    ProcessGain,
    StepDisturbance,
)
from stiction_ros.loop import LoopModel, Plant

QUICK = GapOptions(quick=True)


def found(place: str, effect: Behaviour) -> Discrepancy:
    model, recorded = with_cause(place, effect)
    return find_discrepancy(model, [recorded], QUICK)


@pytest.fixture(scope="module")
def sticky() -> Discrepancy:
    return found("valve:V1", HeStiction(4.0, 1.5))


def test_the_right_model_lacks_nothing() -> None:
    answer = find_discrepancy(loop(), [record(loop(), seed=4)], QUICK)
    assert (answer.verdict, answer.effects) == (GapVerdict.NONE, ())


def test_stiction_is_named_with_its_figures(sticky: Discrepancy) -> None:
    (effect,) = sticky.effects
    assert (sticky.verdict, effect.effect) == (GapVerdict.NAMED, "stiction")
    assert effect.parameters["f_s"] == pytest.approx(4.0, abs=0.1)
    assert effect.parameters["f_d"] == pytest.approx(1.5, abs=0.1)


def test_the_gap_closes_on_held_out_samples(sticky: Discrepancy) -> None:
    assert sticky.closed > 0.9


def test_the_extended_model_runs_as_a_plant(sticky: Discrepancy) -> None:
    model = LoopModel.from_yaml(sticky.model_after.to_yaml())
    stem = Plant(model, 0).apply(np.array([52.0]))
    assert stem == pytest.approx([50.0])  # within the friction found, so it stays


def test_the_extension_has_a_provenance(sticky: Discrepancy) -> None:
    assert sticky.model_after.provenance[-1]["what"] == "stiction"


def test_the_given_model_is_handed_back_unchanged(sticky: Discrepancy) -> None:
    assert sticky.model_before.to_mapping() == loop().to_mapping()


@pytest.mark.parametrize(
    ("place", "effect"),
    [
        ("process:PV1", ProcessGain(1.3)),
        pytest.param("process:PV1", ExtraDelay(4.0), marks=pytest.mark.trial),
    ],
)
def test_one_effect_is_named(place: str, effect: Behaviour) -> None:
    answer = found(place, effect)
    assert [(e.place, e.effect) for e in answer.effects] == [(place, effect.effect)]
    assert answer.verdict is GapVerdict.NAMED


@pytest.mark.trial
def test_backlash_is_told_from_all_but_stiction() -> None:
    answer = found("valve:V1", Backlash(4.0))
    names = {(e.place, e.effect) for e in answer.effects} | set(answer.alternatives)
    assert ("valve:V1", "backlash") in names
    assert names <= {("valve:V1", "backlash"), ("valve:V1", "stiction")}


@pytest.mark.trial
def test_lags_are_left_in_doubt_with_their_family() -> None:
    answer = found("process:PV1", ExtraPole(8.0))
    names = {(e.place, e.effect) for e in answer.effects} | set(answer.alternatives)
    assert names == {("valve:V1", "lag"), ("process:PV1", "pole"), ("sensor:PV1", "lag")}


@pytest.mark.trial
def test_a_measured_stem_speaks_against_a_slow_valve() -> None:
    recorded = record(loop().with_effect("process:PV1", ExtraPole(8.0)), stem=True)
    answer = find_discrepancy(loop(), [recorded], QUICK)
    names = {(e.place, e.effect) for e in answer.effects} | set(answer.alternatives)
    assert names == {("process:PV1", "pole"), ("sensor:PV1", "lag")}


@pytest.mark.trial
@pytest.mark.parametrize(
    ("place", "effect", "left"),
    [
        ("valve:V1", Lag(8.0), {("valve:V1", "lag")}),
        ("process:PV1", ExtraPole(8.0), {("process:PV1", "pole"), ("sensor:PV1", "lag")}),
    ],
)
def test_a_stem_recorded_later_tells_where_the_lag_is(
    place: str, effect: Behaviour, left: set[tuple[str, str]]
) -> None:
    slow = loop().with_effect(place, effect)
    answer = find_discrepancy(loop(), [record(slow), record(slow, 2, stem=True)], QUICK)
    names = {(e.place, e.effect) for e in answer.effects} | set(answer.alternatives)
    assert names == left


@pytest.mark.trial
def test_a_step_may_be_the_sensor_s() -> None:
    answer = found("disturbance:PV1", StepDisturbance(470.0, 1.5))
    assert answer.verdict is GapVerdict.AMBIGUOUS
    assert answer.alternatives == (("sensor:PV1", "bias_step"),)


def test_a_quiet_record_can_show_little() -> None:
    recorded = without_set_points(record(loop(), moves=False))
    answer = find_discrepancy(loop(), [recorded], QUICK)
    assert answer.verdict in (GapVerdict.UNTESTABLE, GapVerdict.NONE)
    assert ("valve:V1", "lag") in {(t.place, t.effect) for t in answer.untestable}


@pytest.mark.trial
def test_the_same_seed_gives_the_same_intervals() -> None:
    model, recorded = with_cause("process:PV1", ProcessGain(1.3))
    options = GapOptions(resamples=10, seed=3)
    first, second = (find_discrepancy(model, [recorded.part(0, 500)], options) for _ in range(2))
    assert first.effects == second.effects
