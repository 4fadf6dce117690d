"""What counts as right, wrong and in doubt."""

import math
from typing import Any

import pytest

from stiction_ros.config_files import find_config
from stiction_ros.effects import Behaviour, HeStiction, SineDisturbance, StepDisturbance
from stiction_ros.loop import LoopModel
from stiction_studies.blind.loops.truth import Hidden, Regime, Truth
from stiction_studies.blind.scores.families import family_of
from stiction_studies.blind.scores.scoring import Score, Scored, claims_of, score
from stiction_studies.blind.scores.tally import coverage, matrix, median_closed, rates, report

REGIME = Regime("first", "normal", "moves", "measurement", False)
STICTION = ("valve:V1", "stiction")
BACKLASH = ("valve:V1", "backlash")
STEP = ("disturbance:PV1", "step")
BIAS = ("sensor:PV1", "bias_step")
GAIN = ("process:PV1", "gain")
SURE = 5.0


def single_loop() -> LoopModel:
    return LoopModel.load(find_config("example1_process.loop.yaml"))


def truth(*hidden: tuple[str, Behaviour], family: str = "single") -> Truth:
    entries = tuple(Hidden(place, behaviour) for place, behaviour in hidden)
    cause = " + ".join(h.behaviour.effect for h in entries) or "none"
    return Truth(family, 1, REGIME, cause, entries)


def effect(
    name: tuple[str, str], *others: tuple[str, str], **intervals: tuple[float, float]
) -> dict[str, Any]:
    return {
        "place": name[0],
        "effect": name[1],
        "intervals": {key: list(ends) for key, ends in intervals.items()},
        "alternatives": [{"place": p, "effect": e} for p, e in others],
    }


def answer(verdict: str, *effects: dict[str, Any], loose: Any = (), closed: float = 0.9) -> Any:
    return {
        "verdict": verdict,
        "effects": list(effects),
        "alternatives": [{"place": p, "effect": e} for p, e in loose],
        "gap": {"closed": closed},
        "seconds": 2.0,
    }


FRICTION = truth(("valve:V1", HeStiction(5.0, 2.0)))
LOAD = truth(("disturbance:PV1", StepDisturbance(10.0, 1.0)))
TWO = truth(
    ("valve:V1", HeStiction(5.0, 2.0)),
    ("disturbance:PV1", SineDisturbance(1.0, 50.0)),
    family="two",
)
SINE = ("disturbance:PV1", "sine")
HEALTHY = truth()
CASES = {
    "named": (FRICTION, answer("named", effect(STICTION)), Score.RIGHT),
    "wrongly named": (FRICTION, answer("named", effect(GAIN)), Score.WRONG),
    "named and another": (FRICTION, answer("named", effect(STICTION), effect(GAIN)), Score.WRONG),
    "its twin named": (LOAD, answer("named", effect(BIAS)), Score.WRONG),
    "its family": (LOAD, answer("ambiguous", effect(BIAS, STEP)), Score.RIGHT),
    "more than its family": (LOAD, answer("ambiguous", effect(STEP, BIAS, GAIN)), Score.DOUBT),
    "less than its family": (FRICTION, answer("ambiguous", effect(STICTION, GAIN)), Score.DOUBT),
    "a set without it": (LOAD, answer("ambiguous", effect(STICTION, BACKLASH)), Score.LOST),
    "a loose set": (LOAD, answer("ambiguous", loose=(STEP, BIAS)), Score.RIGHT),
    "a loose set besides": (
        FRICTION,
        answer("ambiguous", effect(STICTION), loose=(STEP, BIAS)),
        Score.LOST,
    ),
    "nothing": (FRICTION, answer("none"), Score.MISSED),
    "untestable": (FRICTION, answer("untestable"), Score.MISSED),
    "unknown": (FRICTION, answer("unknown"), Score.UNKNOWN),
    "unknown beside it": (FRICTION, answer("unknown", effect(STICTION)), Score.UNKNOWN),
    "healthy": (HEALTHY, answer("none"), Score.QUIET),
    "healthy, named": (HEALTHY, answer("named", effect(GAIN)), Score.WRONG),
    "healthy, a set": (HEALTHY, answer("ambiguous", effect(STEP, BIAS)), Score.ALARM),
    "healthy, unknown": (HEALTHY, answer("unknown"), Score.UNKNOWN),
    "both of two": (TWO, answer("named", effect(STICTION), effect(SINE)), Score.RIGHT),
    "one of two": (TWO, answer("named", effect(SINE)), Score.PART),
    "one of two and another": (TWO, answer("named", effect(SINE), effect(GAIN)), Score.WRONG),
}


def judged(hidden: Truth, said: Any, gain: float = SURE) -> Scored:
    return score(hidden, single_loop(), said, dict.fromkeys(hidden.names, gain))


@pytest.mark.parametrize("case", CASES)
def test_an_answer_gets_its_score(case: str) -> None:
    hidden, said, expected = CASES[case]
    assert judged(hidden, said).score is expected


def test_testable_is_what_beats_none_by_the_margin() -> None:
    said = answer("none")
    assert judged(FRICTION, said, 0.0).testable
    assert not judged(FRICTION, said, -0.1).testable
    assert not score(FRICTION, single_loop(), said, {}).testable
    assert not judged(HEALTHY, said).testable


def test_of_two_both_must_be_testable() -> None:
    gains = dict.fromkeys(TWO.names, SURE) | {SINE: -1.0}
    assert not score(TWO, single_loop(), answer("none"), gains).testable


@pytest.mark.parametrize(
    ("ends", "holds"), [((4.0, 6.0), True), ((5.0, 5.0), True), ((5.1, 6.0), False)]
)
def test_an_interval_covers_the_truth_or_not(ends: tuple[float, float], holds: bool) -> None:
    said = answer("named", effect(STICTION, f_s=ends))
    assert judged(FRICTION, said).covered == {"stiction.f_s": holds}


def test_a_phase_is_compared_on_the_circle() -> None:
    sine = truth(("disturbance:PV1", SineDisturbance(1.0, 50.0, 6.2)))
    said = answer("named", effect(SINE, phase=(-0.2, 0.1)))
    assert judged(sine, said).covered == {"sine.phase": True}


def test_intervals_of_another_effect_are_not_asked() -> None:
    assert judged(LOAD, answer("named", effect(STICTION, f_s=(1.0, 2.0)))).covered == {}


def test_a_named_effect_has_no_alternatives() -> None:
    named, doubted = claims_of(answer("ambiguous", effect(GAIN), effect(STEP, BIAS)))
    assert named.named
    assert not doubted.named
    assert doubted.names == {STEP, BIAS}


FAMILIES = {
    ("valve:V1", "lag"): {("valve:V1", "lag"), ("process:PV1", "pole"), ("sensor:PV1", "lag")},
    ("process:PV1", "gain"): {GAIN},
    ("sensor:PV1", "drift"): {
        ("sensor:PV1", "drift"),
        ("disturbance:PV1", "drift"),
        ("load:V1", "drift"),
    },
    STEP: {STEP, BIAS},
    BACKLASH: {STICTION, BACKLASH},
}


@pytest.mark.parametrize("name", FAMILIES)
def test_an_effect_has_its_family(name: tuple[str, str]) -> None:
    family = family_of(name, single_loop())
    assert family == FAMILIES[name]
    assert all(family_of(other, single_loop()) == family for other in family)


def test_a_valve_of_two_outputs_is_told_from_a_slow_output() -> None:
    tank = LoopModel.load(find_config("tank.loop.yaml"))
    for valve in ("valve:V1", "valve:V2"):
        assert family_of((valve, "lag"), tank) == {(valve, "lag")}
    slow = {("process:T", "pole"), ("sensor:T", "lag")}
    assert family_of(("sensor:T", "lag"), tank) == slow


def test_a_delay_is_a_shifted_clock_where_no_tuning_is_known() -> None:
    known = single_loop().to_mapping()
    known["controller"] = {"kind": "pi", "gain": 1.0, "integral_time": 9.0}
    delay, shift = ("process:PV1", "delay"), ("data", "time_shift")
    assert family_of(delay, single_loop()) == {delay, shift}
    assert family_of(delay, LoopModel.from_mapping(known)) == {delay}


def test_what_the_data_show_closes_no_gap() -> None:
    frozen = answer("named", effect(("sensor:PV1", "freeze")), closed=0.0)
    assert math.isnan(judged(FRICTION, frozen).closed)
    assert judged(FRICTION, answer("named", effect(GAIN), closed=0.0)).closed == 0.0


def test_a_row_survives_json() -> None:
    row = judged(FRICTION, answer("named", effect(STICTION, f_s=(4.0, 6.0))))
    assert Scored.from_mapping(row.to_mapping()) == row
    nothing = judged(FRICTION, answer("none"))
    assert nothing.to_mapping()["closed"] is None
    assert math.isnan(Scored.from_mapping(nothing.to_mapping()).closed)


def rows() -> list[Scored]:
    return [
        judged(FRICTION, answer("named", effect(STICTION, f_s=(4.0, 6.0)), closed=0.8)),
        judged(FRICTION, answer("named", effect(GAIN))),
        judged(FRICTION, answer("none"), -1.0),
        judged(LOAD, answer("ambiguous", effect(STEP, BIAS))),
        judged(LOAD, answer("ambiguous", effect(STICTION, BACKLASH))),
        judged(HEALTHY, answer("none")),
        judged(HEALTHY, answer("named", effect(GAIN))),
    ]


def test_rates_count_what_they_say() -> None:
    found = {rate.name: (rate.count, rate.total) for rate in rates(rows())}
    assert found["wrong name"] == (1, 5)
    assert found["false alarm, healthy"] == (1, 2)
    assert found["false alarm, tight"] == (0, 0)
    assert found["testable"] == (4, 5)
    assert found["right among testable"] == (2, 4)
    assert found["truth in the set of ambiguous"] == (1, 2)


def test_what_right_names_close_is_a_median() -> None:
    assert median_closed(rows()) == pytest.approx(0.85)


def test_coverage_counts_all_and_each_parameter() -> None:
    found = {rate.name: (rate.count, rate.total) for rate in coverage(rows())}
    assert found == {"intervals": (1, 1), "stiction.f_s": (1, 1)}


def test_the_matrix_has_a_row_per_cause() -> None:
    found = matrix(rows())
    assert found["stiction"] == {"valve stiction": 1, "process gain": 1, "none": 1}
    assert found["step"] == {"its family": 1, "set without it": 1}


def test_a_report_of_nothing_holds_no_figures() -> None:
    empty = report([])
    assert (empty["loops"], empty["closed_median"], empty["matrix"]) == (0, None, {})
