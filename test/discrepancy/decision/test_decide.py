"""What scores allow to say."""

import dataclasses

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.decision.decide import (
    Decision,
    GapVerdict,
    borne_out,
    decide,
    verdict_of,
)
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Axis, Behaviour, FloatArray

MARGIN = 10.0


class Named(Candidate):
    """A candidate that is only a name."""

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        raise NotImplementedError

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour | None:
        raise NotImplementedError


def fit(
    place: str, effect: str, delta_bic: float, held: float = 5.0, inside: bool = True
) -> CandidateFit:
    factors = np.array([0.5])
    twins = (("sensor:PV1", "bias_step"),) if effect == "step" else ()
    axes = (Axis(0.0, 10.0, 5),)
    candidate = Named(place=place, effect=effect, axes=axes, twins=twins, inside=inside)
    return CandidateFit(candidate, np.array([3.0]), factors, {}, delta_bic, held)


class Creeping(Named):
    def leaps(self, point: FloatArray) -> bool:
        return False


def said(*fits: CandidateFit, departures: int = 100) -> Decision:
    return decide(fits, MARGIN, lambda fit: departures)


def test_a_clear_winner_is_named() -> None:
    answer = said(fit("valve:V1", "slew", 80.0), fit("process:PV1", "gain", 60.0))
    assert answer.verdict is GapVerdict.NAMED


def test_a_rival_within_the_margin_leaves_doubt() -> None:
    answer = said(fit("valve:V1", "slew", 80.0), fit("process:PV1", "gain", 72.0))
    assert (answer.verdict, answer.inseparable) == (GapVerdict.AMBIGUOUS, False)


def test_a_twin_leaves_doubt_that_one_addition_serves() -> None:
    answer = said(fit("disturbance:PV1", "step", 80.0))
    assert (answer.verdict, answer.inseparable) == (GapVerdict.AMBIGUOUS, True)


def test_less_than_the_margin_is_nothing() -> None:
    assert said(fit("valve:V1", "slew", 9.0, held=0.5)).verdict is GapVerdict.NONE


def test_held_out_rows_veto() -> None:
    assert said(fit("valve:V1", "slew", 24.0, held=-9.5)).verdict is GapVerdict.NONE


def test_a_small_loss_of_a_weak_effect_on_held_out_rows_is_chance() -> None:
    assert said(fit("valve:V1", "slew", 24.0, held=-2.0)).verdict is GapVerdict.NAMED


def test_a_large_gap_that_held_out_rows_refuse_is_unknown() -> None:
    assert said(fit("valve:V1", "slew", 200.0, held=-1.0)).verdict is GapVerdict.UNKNOWN


def test_held_out_rows_count_between_rivals() -> None:
    answer = said(
        fit("disturbance:PV1", "drift", 22.0, 90.0), fit("process:PV1", "gain", 20.0, 2.0)
    )
    assert answer.verdict is GapVerdict.NAMED


def test_a_rival_below_the_threshold_leaves_doubt() -> None:
    answer = said(fit("valve:V1", "slew", 11.0, 1.0), fit("process:PV1", "delay", 5.0, 0.5))
    assert answer.alternatives == (("process:PV1", "delay"),)


def test_a_valve_that_hardly_ever_moves_does_not_show_that_there_is_no_jump() -> None:
    answer = said(
        fit("valve:V1", "stiction", 84.0), fit("valve:V1", "backlash", 90.0), departures=3
    )
    assert answer.alternatives == (("valve:V1", "stiction"),)


def test_a_better_rival_outside_the_catalogue_is_unknown() -> None:
    answer = said(
        fit("valve:V1", "slew", 80.0), fit("process:PV1", "other dynamics", 90.0, inside=False)
    )
    assert answer.verdict is GapVerdict.UNKNOWN


def test_what_gains_most_and_held_out_rows_refuse_is_lent() -> None:
    refused = fit("process:PV1", "gain", 120.0, held=-5.0)
    answer = said(refused)
    assert (answer.verdict, answer.chosen, answer.lent) == (GapVerdict.UNKNOWN, None, refused)


def test_what_is_refused_is_lent_before_less_is_named() -> None:
    refused = fit("valve:V1", "characteristic", 400.0, held=-60.0)
    less = fit("process:PV1", "gain", 200.0)
    answer = said(refused, less)
    assert (answer.verdict, answer.lent) == (GapVerdict.UNKNOWN, refused)
    near = dataclasses.replace(less, delta_bic=330.0)
    assert said(refused, near).chosen is near


def test_what_a_rival_outside_the_catalogue_beats_is_not_lent() -> None:
    refused = fit("process:PV1", "gain", 120.0, held=-5.0)
    stranger = fit("process:PV1", "gain that changes", 140.0, inside=False)
    step = fit("load:V1", "step", 30.0)
    assert said(refused, stranger, step).lent is None
    less = dataclasses.replace(stranger, delta_bic=100.0)
    assert said(refused, less, step).lent is refused


def test_a_lag_is_named_wherever_it_is() -> None:
    places = [("sensor:PV1", "lag"), ("valve:V1", "lag")]
    assert verdict_of("pole", places) is GapVerdict.NAMED
    assert verdict_of("pole", [*places, ("process:PV1", "delay")]) is GapVerdict.AMBIGUOUS
    assert verdict_of("stiction", ()) is GapVerdict.NAMED
    assert verdict_of("step", [("sensor:PV1", "bias_step")]) is GapVerdict.AMBIGUOUS


def test_a_lag_that_nothing_places_is_the_order_of_the_process() -> None:
    answer = said(fit("valve:V1", "lag", 90.3), fit("process:PV1", "pole", 90.0))
    assert answer.chosen is not None
    assert answer.chosen.candidate.key == ("process:PV1", "pole")
    assert answer.alternatives == (("valve:V1", "lag"),)


def test_a_clear_jump_is_stiction() -> None:
    answer = said(fit("valve:V1", "stiction", 91.0), fit("valve:V1", "backlash", 80.0))
    assert answer.chosen is not None
    assert (answer.verdict, answer.chosen.candidate.effect) == (GapVerdict.NAMED, "stiction")


def test_no_jump_is_backlash() -> None:
    answer = said(fit("valve:V1", "stiction", 84.0), fit("valve:V1", "backlash", 90.0))
    assert answer.chosen is not None
    assert (answer.verdict, answer.chosen.candidate.effect) == (GapVerdict.NAMED, "backlash")


def test_a_jump_that_gains_more_than_chance_is_not_absent() -> None:
    answer = said(fit("valve:V1", "stiction", 86.0), fit("valve:V1", "backlash", 90.0))
    assert answer.alternatives == (("valve:V1", "stiction"),)


def test_a_doubtful_jump_names_the_family() -> None:
    answer = said(fit("valve:V1", "stiction", 90.0), fit("valve:V1", "backlash", 89.0))
    assert answer.alternatives == (("valve:V1", "backlash"),)


def test_a_jump_that_is_next_to_nothing_names_the_family() -> None:
    jumping = fit("valve:V1", "stiction", 120.0)
    candidate = Creeping(place="valve:V1", effect="stiction", axes=jumping.candidate.axes)
    jumping = dataclasses.replace(jumping, candidate=candidate)
    answer = said(jumping, fit("valve:V1", "backlash", 80.0))
    assert answer.chosen is jumping
    assert answer.alternatives == (("valve:V1", "backlash"),)


def test_weak_friction_names_the_family() -> None:
    answer = said(fit("valve:V1", "backlash", 20.0), fit("valve:V1", "stiction", 14.0))
    assert answer.alternatives == (("valve:V1", "stiction"),)


def test_a_step_is_looked_at_before_a_change_that_contains_it() -> None:
    step = fit("disturbance:PV1", "step", 80.0)
    change = fit("process:PV1", "gain that changes", 90.0, inside=False)
    steps = (("disturbance:PV1", "step"),)
    other = dataclasses.replace(change.candidate, contains=steps)
    change = dataclasses.replace(change, candidate=other)
    answer = said(step, change)
    assert answer.chosen is step


def test_what_comes_at_one_moment_need_not_show_on_held_out_rows() -> None:
    assert not borne_out(700.0, -5.0, dated=False)
    assert borne_out(700.0, -5.0, dated=True)
