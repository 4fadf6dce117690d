"""Loops of the world of others that were answered wrongly once; the principle that answers them."""

import dataclasses

import numpy as np
import pytest

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.discrepancy.data.controller_check import ControllerStatus, check_controller
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.effects import Tuning
from stiction_ros.loop import LoopModel
from stiction_ros.loop.model import PiTuning
from stiction_studies.blind.loops.generator import blind_loop
from stiction_studies.field.hidden import hidden_loop

QUICK = GapOptions(quick=True)


def answered(
    seed: int, stem: bool = True, given: str = "exact", family: str = "single"
) -> Discrepancy:
    loop = hidden_loop(seed, family, given)
    record = loop.record if stem else dataclasses.replace(loop.record, stem=None)
    return find_discrepancy(LoopModel.from_mapping(loop.given), [record], QUICK)


def names(answer: Discrepancy) -> list[tuple[str, str]]:
    return [(each.place, each.effect) for each in answer.effects]


@pytest.mark.trial
def test_noise_of_the_equation_does_not_hide_what_an_effect_closes() -> None:
    answer = answered(601)  # a pole; the declared noise wanders farther than the pole moves PV
    (found,) = answer.effects
    assert {(found.place, found.effect), *found.alternatives} == {
        ("process:PV1", "pole"),
        ("sensor:PV1", "lag"),
        ("valve:V1", "lag"),
    }
    assert found.closed > 0.9


@pytest.mark.trial
def test_a_recorded_stem_tells_a_lag_of_the_valve_from_those_behind_it() -> None:
    told = answered(629)
    assert names(told) == [("valve:V1", "lag")]
    assert told.verdict is GapVerdict.NAMED
    (untold,) = answered(629, stem=False).effects
    assert untold.verdict is GapVerdict.NAMED  # where it is stays open
    assert {("process:PV1", "pole"), ("valve:V1", "lag")} <= {
        (untold.place, untold.effect),
        *untold.alternatives,
    }


@pytest.mark.trial
def test_a_named_effect_of_the_process_is_no_correction_of_the_model() -> None:
    answer = answered(638)  # one sample more of dead time
    assert names(answer) == [("process:PV1", "delay")]
    assert answer.effects[0].parameters["extra"] == pytest.approx(1.0, abs=0.3)
    assert answer.process_changes == ()


@pytest.mark.trial
def test_a_model_that_is_off_is_mended_before_steps_are_seen_in_it() -> None:
    answer = answered(240, given="off")  # an open loop that begins the wrong way, little noise
    assert names(answer) == [("valve:V1", "characteristic")]
    (change,) = answer.process_changes  # the others are too small to matter
    assert change.what == "lead"
    loop = hidden_loop(240, given="off")
    lead = loop.base.plant.lead / loop.known.lead
    assert change.value == pytest.approx(lead, abs=0.03)


@pytest.mark.trial
def test_no_noise_is_named_that_explains_less_than_a_wave_in_doubt() -> None:
    answer = answered(220, given="off")  # a triangle of the load with nine periods
    assert answer.verdict is GapVerdict.AMBIGUOUS
    assert ("load:V1", "triangle") in answer.alternatives


@pytest.mark.trial
def test_fine_rounding_beside_noise_of_the_equation_is_no_noise_of_its_own() -> None:
    assert names(answered(700)) == [("disturbance:PV1", "triangle")]


def test_another_reset_is_told_though_the_gain_makes_nearly_all_moves() -> None:
    seen, _ = blind_loop(95109, "single")  # no set-point moves: Δe is far more than its reset
    runs, _ = open_gate(seen.model, [seen.record])
    check = check_controller(seen.model, runs)
    assert check.status is ControllerStatus.OTHER
    assert check.finding is not None
    assert isinstance(check.finding.behaviour, Tuning)
    assert check.finding.behaviour.integral_time == pytest.approx(60.83, abs=0.01)


@pytest.mark.parametrize(("factor", "other"), [(0.97, False), (0.8, True)])
def test_a_tuning_is_another_one_by_a_size_that_matters(factor: float, other: bool) -> None:
    loop = hidden_loop(600)  # its controller scans twice in a sample of the record
    model = LoopModel.from_mapping(loop.given)
    assert isinstance(model.controller, PiTuning)
    runs, _ = open_gate(model, [loop.record])
    assert check_controller(model, runs).finding is None
    error = runs.records[0].sp[:, 0] - runs.pv[:, 0]
    gain, time = model.controller.gain, model.controller.integral_time / factor
    moves = gain * np.diff(error, prepend=error[0]) + gain * runs.sample_time / time * error
    op = 50.0 + 0.2 * np.cumsum(moves - moves.mean())
    scaled = dataclasses.replace(model, controller=PiTuning(0.2 * gain, 0.0 + time * factor))
    record = dataclasses.replace(loop.record, op=op[:, None])
    again, _ = open_gate(scaled, [record])
    check = check_controller(scaled, again)
    assert (check.finding is not None) is other
    assert check.status is (ControllerStatus.OTHER if other else ControllerStatus.SAME)


@pytest.mark.trial
def test_a_gain_that_a_curve_explains_as_well_is_no_correction_of_the_model() -> None:
    answer = answered(838)  # a quadratic characteristic of which the set-points see the slope
    assert answer.verdict is GapVerdict.AMBIGUOUS
    assert {("process:PV1", "gain"), ("valve:V1", "characteristic")} <= set(answer.alternatives)
    assert answer.process_changes == ()


@pytest.mark.trial
@pytest.mark.parametrize("seed", [141, 700099])
def test_a_curve_that_is_no_exponential_is_one_effect(seed: int) -> None:
    answer = answered(seed)  # a quadratic characteristic
    assert names(answer) == [("valve:V1", "characteristic")]
    assert answer.process_changes == ()
    true = -25.0 * hidden_loop(seed).hidden[0].figures["curve"]
    assert answer.effects[0].parameters["bend"] == pytest.approx(true, rel=0.1)


@pytest.mark.trial
@pytest.mark.parametrize("seed", [700100, 710249, 710281])
def test_a_lag_that_moves_on_between_samples_is_told_from_another_process(seed: int) -> None:
    answer = answered(seed)
    (found,) = answer.effects
    told = {(found.place, found.effect), *found.alternatives}
    assert told == {("valve:V1", "lag"), ("process:PV1", "pole"), ("sensor:PV1", "lag")}


@pytest.mark.trial
@pytest.mark.parametrize("seed", [79189, 78520])  # a dead time and a time constant before
def test_a_slew_between_samples_is_no_other_process(seed: int) -> None:
    answer = answered(seed)
    assert names(answer) == [("valve:V1", "slew")]
    assert answer.process_changes == ()


@pytest.mark.trial
def test_a_second_scan_that_leaves_half_a_percent_of_the_moves_is_told() -> None:
    answer = answered(79333)  # a curve in a tight loop
    assert answer.process_changes == ()
    assert ("valve:V1", "characteristic") in names(answer)


@pytest.mark.trial
def test_a_curve_is_stepped_with_the_process_that_stands_in_for_it() -> None:
    answer = answered(302, given="off")
    assert names(answer) == [("valve:V1", "characteristic")]
    assert not any(noise.dependent for noise in answer.noise)


@pytest.mark.trial
@pytest.mark.parametrize("seed", [875, 193])  # in closed loop, and moved by hand
def test_a_rounded_op_in_a_healthy_loop_is_no_coloured_noise(seed: int) -> None:
    answer = answered(seed)
    assert answer.verdict is GapVerdict.NONE
    assert names(answer) == []


@pytest.mark.trial
@pytest.mark.parametrize(
    ("seed", "effect"),
    [
        (143, ("disturbance:PV1", "coloured")),  # eighteen times the declared noise
        (187, ("load:V1", "drift")),  # of a level, whose sensor has spikes
    ],
)
def test_a_walk_is_named_where_there_is_one(seed: int, effect: tuple[str, str]) -> None:
    answer = answered(seed)
    assert names(answer) == [effect]
    assert answer.effects[0].verdict is GapVerdict.NAMED


@pytest.mark.trial
@pytest.mark.parametrize(
    ("seed", "effect"),
    [
        (115, ("load:V1", "step")),  # a larger noise hides it but for its first samples
        (132, ("load:V1", "square")),  # no noise is declared
    ],
)
def test_what_stands_out_under_noise_of_the_equation_is_found(
    seed: int, effect: tuple[str, str]
) -> None:
    answer = answered(seed)
    assert names(answer) == [effect]
    assert answer.effects[0].closed > 0.9


@pytest.mark.trial
def test_a_cycle_over_most_of_op_is_a_friction_that_moves_within_samples() -> None:
    answer = answered(79693)  # another time constant of the process before, beside backlash
    assert (names(answer), answer.process_changes) == ([("valve:V1", "stiction")], ())


def test_a_tuning_is_told_from_rounded_values() -> None:
    (found,) = (each for each in answered(189).effects if each.place == "data")
    tuning = hidden_loop(189).hidden[0].figures
    assert found.parameters["gain"] == pytest.approx(tuning["gain"], rel=0.02)
    assert found.parameters["integral_time"] == pytest.approx(tuning["integral_time"], rel=0.02)


@pytest.mark.trial
def test_a_model_that_is_off_is_mended_under_the_walk_that_is_there() -> None:
    answer = answered(319, given="off")
    assert names(answer) == [("load:V1", "random_walk")]
    change = next(each for each in answer.process_changes if each.what == "delay")
    loop = hidden_loop(319, given="off")
    low, high = change.interval
    assert low <= loop.base.plant.dead_time - loop.known.dead_time <= high


@pytest.mark.trial
def test_a_step_closes_what_it_closes_at_its_moment() -> None:
    (found,) = answered(378, given="off").effects  # noise of the equation, a fitted block
    assert (found.place, found.effect) == ("disturbance:PV1", "step")
    assert found.closed > 0.9


@pytest.mark.trial
def test_a_curve_is_judged_with_the_changed_process_left_open() -> None:
    assert names(answered(340, given="off")) == [("valve:V1", "characteristic")]


@pytest.mark.trial
def test_a_lag_is_stepped_with_the_process_that_stands_in_for_it() -> None:
    found, *others = answered(352, given="off").effects
    assert ("sensor:PV1", "lag") in {(found.place, found.effect), *found.alternatives}
    assert found.closed > 0.9
    assert {each.effect for each in others} <= {"gain"}  # which the model is off by


@pytest.mark.trial
def test_a_dead_time_far_beyond_an_error_of_the_model_is_told() -> None:
    answer = answered(320, given="off")
    late = [each for each in answer.process_changes if each.what == "delay"]
    assert late or names(answer) == [("process:PV1", "delay")]


@pytest.mark.trial
def test_a_set_in_doubt_that_leaves_a_larger_noise_is_no_answer() -> None:
    answer = answered(162)  # healthy; a controller that scans twice in a sample, OP rounded
    assert answer.verdict is GapVerdict.UNKNOWN
    assert answer.alternatives == ()


@pytest.mark.trial
def test_noise_behind_an_effect_is_searched_from_where_the_effect_was_found() -> None:
    answer = answered(110059)  # a slew where the model declares no noise
    assert names(answer) == [("valve:V1", "slew")]


@pytest.mark.trial
@pytest.mark.parametrize(("seed", "first"), [(841, "saturation"), (130038, "stiction")])
def test_a_sine_is_found_beside_what_was_found_first(seed: int, first: str) -> None:
    valve, wave = answered(seed, family="two").effects
    assert (valve.place, valve.effect) == ("valve:V1", first)
    places = {wave.place, *(place for place, effect in wave.alternatives if effect == "sine")}
    assert wave.effect == "sine"
    assert places == {"disturbance:PV1", "load:V1"}


@pytest.mark.trial
def test_a_step_that_held_out_rows_refuse_does_not_take_in_one_at_another_place() -> None:
    assert names(answered(101)) == [("valve:V1", "stiction")]


@pytest.mark.trial
def test_a_slew_of_a_stem_that_was_late_at_the_start_is_one_effect() -> None:
    assert names(answered(61)) == [("valve:V1", "slew")]


@pytest.mark.trial
def test_the_rate_of_a_slew_is_no_slope_of_its_signal() -> None:
    assert names(answered(596)) == [("valve:V1", "slew")]


@pytest.mark.trial
def test_how_late_within_a_sample_a_stem_slips_is_no_dead_time() -> None:
    answer = answered(313, family="physics")
    assert names(answer) == [("valve:V1", "stiction")]
    assert not answer.noise[0].disagrees


@pytest.mark.trial
def test_a_square_load_that_changes_sides_between_samples_is_one() -> None:
    assert names(answered(322, family="two")) == [("valve:V1", "stiction"), ("load:V1", "square")]


@pytest.mark.trial
def test_a_start_that_nobody_sees_is_no_contradiction_to_a_recorded_stem() -> None:
    assert names(answered(740020)) == [("valve:V1", "slew")]


@pytest.mark.trial
def test_a_recorded_stem_refuses_no_load() -> None:
    assert names(answered(321, family="two")) == [("valve:V1", "slew"), ("load:V1", "square")]


@pytest.mark.trial
def test_what_is_in_doubt_beside_another_effect_is_told_when_that_is_found() -> None:
    answer = answered(351, family="two")  # a curve, or a gain; and a drift
    assert names(answer)[1:] == [("valve:V1", "characteristic"), ("disturbance:PV1", "drift")]
    assert answer.effects[1].alternatives == ()


@pytest.mark.trial
def test_a_noise_that_is_not_said_stands_against_no_effect() -> None:
    answer = answered(315, family="two")  # a step of the load behind coarse rounding
    assert ("load:V1", "step") in names(answer)


@pytest.mark.trial
def test_a_needle_is_looked_for_over_the_whole_length_of_its_valley() -> None:
    answer = answered(561)  # the lattice and the boxes around its best points led to a walk
    (found,) = answer.effects
    assert (found.effect, found.alternatives) == ("stiction", ())
    assert found.parameters["f_s"] == pytest.approx(7.862, rel=0.01)
    assert found.parameters["f_d"] == pytest.approx(2.531, rel=0.02)


@pytest.mark.trial
def test_two_spikes_in_a_row_are_no_steps() -> None:
    friction, wave = answered(399, family="two").effects
    assert ("valve:V1", "backlash") in {(friction.place, friction.effect), *friction.alternatives}
    assert (wave.place, wave.effect) == ("disturbance:PV1", "sine")


@pytest.mark.trial
def test_values_between_kept_ones_are_no_evidence() -> None:
    kept = answered(315)  # a gain, three values of four between kept ones
    assert names(kept) == [("process:PV1", "gain")]
    assert 0.6 < np.mean(kept.runs.filled) < 0.8
    assert answered(828).verdict is GapVerdict.NONE  # healthy


@pytest.mark.trial
def test_a_step_is_fitted_wherever_it_happens() -> None:
    answer = answered(510002, family="two")  # a step of the load among rows that are kept back
    assert names(answer) == [("valve:V1", "characteristic"), ("load:V1", "step")]


@pytest.mark.trial
def test_a_step_of_a_level_is_one_innovation_and_is_fitted() -> None:
    (found,) = answered(700005).effects
    true = hidden_loop(700005).hidden[0].figures
    assert (found.place, found.effect) == ("disturbance:PV1", "step")
    assert found.parameters["time"] == pytest.approx(true["time"])
    assert found.parameters["size"] == pytest.approx(true["size"], rel=0.03)


@pytest.mark.parametrize("seed", [700127, 700219])
def test_a_healthy_loop_that_scans_twice_and_keeps_no_set_point_lacks_nothing(seed: int) -> None:
    assert answered(seed).verdict is GapVerdict.NONE


@pytest.mark.trial
def test_a_hundredth_of_what_a_law_explains_is_no_second_effect() -> None:
    answer = answered(500443)  # OP is rounded; a square makes up for what is left of a triangle
    assert names(answer) == [("disturbance:PV1", "triangle")]
    assert not answer.effects[0].alternatives


@pytest.mark.trial
def test_what_held_out_rows_refuse_is_tried_before_less_is_named() -> None:
    answer = answered(510123, family="two")  # an open loop, a step of the load in a held-out block
    assert names(answer) == [("valve:V1", "characteristic"), ("load:V1", "step")]
    truth = hidden_loop(510123, "two").hidden[0].figures["curve"]
    assert answer.effects[0].parameters["curve"] == pytest.approx(truth, rel=1e-3)


@pytest.mark.trial
def test_what_comes_next_is_seen_beside_other_figures_of_what_was_found() -> None:
    answer = answered(510067, family="two")  # stiction; a step pulled its figures at first
    assert names(answer)[0] == ("valve:V1", "stiction")
    (step,) = answer.effects[1:]
    assert ("disturbance:PV1", "step") in {(step.place, step.effect), *step.alternatives}


@pytest.mark.trial
def test_friction_of_a_level_closes_what_it_closes_in_one_step() -> None:
    answer = answered(550058, family="physics")  # slips that are a little off add up in a level
    (found,) = answer.effects
    assert (found.place, found.effect) == ("valve:V1", "stiction")
    assert found.closed > 0.4
    assert any(each.startswith("beside what was found") for each in answer.where)


@pytest.mark.trial
def test_what_is_known_of_a_friction_is_not_lost_when_it_is_told_again() -> None:
    answer = answered(610004, family="two")  # a search of everything misses the needle
    assert names(answer)[0] == ("valve:V1", "stiction")
    (sine,) = answer.effects[1:]
    assert ("load:V1", "sine") in {(sine.place, sine.effect), *sine.alternatives}
