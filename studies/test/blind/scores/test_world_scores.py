"""Answers about loops of the field: what is right, wrong and in doubt."""

import dataclasses
import math
from typing import Any

import pytest

from stiction_studies.blind.scores.world_scores import WorldScore, score
from stiction_studies.blind.scores.world_tally import median_closed, rates, report
from stiction_studies.field.hidden import Effect, HiddenLoop, hidden_loop
from stiction_studies.field.hidden.effect import LOAD, OUTPUT, PROCESS, SENSOR, VALVE
from stiction_studies.field.hidden.oracle import Gain

FRICTION = Effect(VALVE, "stiction", {"f_s": 4.0, "f_d": 2.0})
KARNOPP = dataclasses.replace(FRICTION, law="karnopp")
STEP = Effect(LOAD, "step", {"time": 100.0, "size": 2.0})
LAG = Effect(SENSOR, "lag", {"tau": 10.0}, slack={"tau": 1.0})
ENDS = Effect(VALVE, "saturation", {"low": 0.0, "high": 61.0}, untold=("low",))


@pytest.fixture(scope="module")
def loop() -> HiddenLoop:
    return hidden_loop(3)


def effect(place: str, name: str, *others: tuple[str, str], **figures: Any) -> dict[str, Any]:
    intervals = {key: list(value) for key, value in figures.items() if isinstance(value, tuple)}
    return {
        "place": place,
        "effect": name,
        "parameters": {k: v for k, v in figures.items() if not isinstance(v, tuple)},
        "intervals": intervals,
        "alternatives": [{"place": p, "effect": e} for p, e in others],
    }


def said(*effects: dict[str, Any], verdict: str = "named", loose: Any = ()) -> dict[str, Any]:
    return {
        "verdict": verdict if effects or loose or verdict == "unknown" else "none",
        "effects": list(effects),
        "alternatives": [{"place": p, "effect": e} for p, e in loose],
        "gap": {"closed": 0.97},
    }


def judged(
    loop: HiddenLoop, hidden: tuple[Effect, ...], answer: dict[str, Any], **changes: Any
) -> WorldScore:
    loop = dataclasses.replace(loop, hidden=hidden, also=frozenset(), **changes)
    gains = tuple(Gain(e.key, 200.0, 50.0, (PROCESS, "gain")) for e in hidden)
    return score(loop, "exact", answer, gains, 1.5)


def test_the_hidden_effect_is_right_by_name(loop: HiddenLoop) -> None:
    row = judged(loop, (FRICTION,), said(effect(VALVE, "stiction")))
    assert (row.right, row.alarm, row.silent) == (True, False, False)
    assert row.gain() == 50.0
    assert row.gain_over_none() == 200.0


def test_what_is_named_beside_it_is_wrong(loop: HiddenLoop) -> None:
    row = judged(loop, (FRICTION,), said(effect(VALVE, "stiction"), effect(PROCESS, "gain")))
    assert not row.right
    assert row.wrong == ("process gain",)


def test_backlash_is_another_name_for_mechanics_and_not_for_a_jump(loop: HiddenLoop) -> None:
    answer = said(effect(VALVE, "backlash"))
    assert judged(loop, (KARNOPP,), answer).right
    assert judged(loop, (FRICTION,), answer).wrong == ("valve backlash",)


def test_the_actuator_of_a_mechanical_stem_has_a_lag(loop: HiddenLoop) -> None:
    lags = effect(SENSOR, "lag", (PROCESS, "pole"), (VALVE, "lag"))
    answer = said(effect(VALVE, "stiction"), lags, verdict="ambiguous")
    assert judged(loop, (KARNOPP,), answer).right
    assert judged(loop, (FRICTION,), answer).alarm
    assert judged(loop, (KARNOPP,), said(effect(PROCESS, "pole"))).wrong == ("process pole",)


def test_a_family_in_doubt_is_right_and_more_than_it_is_not(loop: HiddenLoop) -> None:
    lags = ((PROCESS, "pole"), (VALVE, "lag"))
    exactly = said(effect(SENSOR, "lag", *lags), verdict="ambiguous")
    assert judged(loop, (LAG,), exactly).right
    more = said(effect(SENSOR, "lag", *lags, (VALVE, "slew")), verdict="ambiguous")
    row = judged(loop, (LAG,), more)
    assert (row.right, row.sets, row.held, row.alarm) == (False, 1, 1, False)


def test_a_set_without_the_truth_is_an_alarm(loop: HiddenLoop) -> None:
    row = judged(
        loop, (FRICTION,), said(effect(OUTPUT, "step", (SENSOR, "bias_step")), verdict="ambiguous")
    )
    assert (row.sets, row.held, row.alarm, row.right) == (1, 0, True, False)


def test_a_set_that_nothing_was_added_for_counts_too(loop: HiddenLoop) -> None:
    row = judged(
        loop, (STEP,), said(verdict="ambiguous", loose=[(LOAD, "step"), (PROCESS, "gain")])
    )
    assert (row.sets, row.held, row.right) == (1, 1, False)


def test_nothing_found_is_silent_and_unknown_is_not(loop: HiddenLoop) -> None:
    assert judged(loop, (STEP,), said()).silent
    row = judged(loop, (STEP,), said(verdict="unknown"))
    assert not row.silent
    assert not row.right


def test_rounding_alone_is_silent_about_what_is_hidden(loop: HiddenLoop) -> None:
    rounding = dataclasses.replace(loop, hidden=(STEP,), also=frozenset({(SENSOR, "quantisation")}))
    gains = (Gain(STEP.key, 200.0, 50.0, (PROCESS, "gain")),)
    row = score(rounding, "exact", said(effect(SENSOR, "quantisation")), gains, 1.0)
    assert row.silent
    assert not row.alarm


def test_two_are_right_together_alone(loop: HiddenLoop) -> None:
    both = (FRICTION, STEP)
    assert judged(loop, both, said(effect(VALVE, "stiction"), effect(LOAD, "step"))).right
    assert not judged(loop, both, said(effect(VALVE, "stiction"))).right


def test_healthy_loops_are_right_when_nothing_is_claimed(loop: HiddenLoop) -> None:
    assert not judged(loop, (), said()).alarm
    assert judged(loop, (), said(effect(VALVE, "slew"))).alarm


def test_what_the_record_holds_besides_may_be_named(loop: HiddenLoop) -> None:
    bare = dataclasses.replace(loop, hidden=(), also=frozenset({(SENSOR, "quantisation")}))
    row = score(bare, "exact", said(effect(SENSOR, "quantisation")), (), 1.0)
    assert not row.alarm


def test_process_changes_are_right_in_the_true_direction(loop: HiddenLoop) -> None:
    plant = loop.base.plant
    weaker = dataclasses.replace(plant, gain=plant.gain / 1.1)
    larger, smaller = (effect(PROCESS, "gain", factor=f) for f in (1.1, 0.9))
    assert not judged(loop, (), said(larger), known=weaker).alarm
    changed = said() | {"process_changes": [{"what": "gain"}]}
    assert judged(loop, (), changed, known=plant).wrong == ("process gain",)
    assert judged(loop, (), changed, known=weaker).wrong == ()
    assert judged(loop, (), said(smaller), known=weaker).alarm
    left_open = ((PROCESS, "gain"), (VALVE, "characteristic"))
    assert judged(loop, (), said(loose=left_open, verdict="ambiguous"), known=weaker).held == 1
    assert judged(loop, (), said(loose=left_open, verdict="ambiguous"), known=plant).held == 0
    faster = dataclasses.replace(plant, lags=tuple(0.9 * lag for lag in plant.lags))
    slower = dataclasses.replace(plant, lags=tuple(1.1 * lag for lag in plant.lags))
    assert not judged(loop, (), said(effect(PROCESS, "pole")), known=faster).alarm
    assert judged(loop, (), said(effect(PROCESS, "pole")), known=slower).alarm


@pytest.mark.parametrize(
    ("ends", "holds"), [((9.0, 9.5), True), ((8.0, 8.5), False), ((10.5, 12.0), True)]
)
def test_intervals_are_given_the_slack_of_their_definition(
    loop: HiddenLoop, ends: tuple[float, float], holds: bool
) -> None:
    row = judged(loop, (LAG,), said(effect(SENSOR, "lag", tau=ends)))
    assert row.covered == {"lag.tau": holds}


def test_an_end_that_is_never_reached_and_mechanics_have_nothing_to_cover(loop: HiddenLoop) -> None:
    row = judged(
        loop, (ENDS,), said(effect(VALVE, "saturation", low=(10.0, 20.0), high=(60.0, 62.0)))
    )
    assert row.covered == {"saturation.high": True}
    answer = said(effect(VALVE, "stiction", f_s=(1.0, 2.0)))
    assert judged(loop, (KARNOPP,), answer).covered == {}


def test_rows_survive_their_mapping(loop: HiddenLoop) -> None:
    row = judged(loop, (FRICTION,), said(effect(VALVE, "stiction")))
    assert WorldScore.from_mapping(row.to_mapping()).to_mapping() == row.to_mapping()
    none = dataclasses.replace(judged(loop, (), said()), closed=math.nan)
    assert none.to_mapping()["closed"] is None
    assert math.isnan(WorldScore.from_mapping(none.to_mapping()).closed)


def test_rates_count_what_they_say(loop: HiddenLoop) -> None:
    rows = [
        judged(loop, (FRICTION,), said(effect(VALVE, "stiction"))),
        judged(loop, (FRICTION,), said()),
        judged(loop, (FRICTION,), said(effect(PROCESS, "gain"))),
        judged(loop, (), said()),
        judged(loop, (), said(effect(VALVE, "slew"))),
    ]
    found = {rate.name: (rate.count, rate.total) for rate in rates(rows)}
    assert found["named what is not there"] == (2, 5)
    assert found["healthy: false alarm"] == (1, 2)
    assert found["right of those"] == (1, 3)
    assert found["none, oracle gains 100"] == (1, 3)
    assert median_closed(rows) == pytest.approx(0.97)
    (name,) = report(rows)["parts"]
    assert name == "single, exact"
