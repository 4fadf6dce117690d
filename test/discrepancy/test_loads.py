"""Loads where they enter, and their shapes."""

import numpy as np
import pytest
from gap_loops import loop, record

from stiction_ros.discrepancy import Discrepancy, GapOptions, find_discrepancy
from stiction_ros.discrepancy.candidate.wave import (
    A_FREQUENCY,
    LOAD,
    StepCandidate,
    disturbance_candidates,
)
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import (
    Behaviour,
    SineDisturbance,
    SquareDisturbance,
    StepDisturbance,
    TriangleDisturbance,
)
from stiction_studies.blind.loops.generator import blind_loop

QUICK = GapOptions(quick=True)


def found(place: str, effect: Behaviour) -> Discrepancy:
    model = loop(0.05)
    return find_discrepancy(model, [record(model.with_effect(place, effect), seed=2)], QUICK)


@pytest.mark.trial
def test_a_step_of_the_load_is_told_from_one_of_the_output() -> None:
    answer = found("load:V1", StepDisturbance(430.0, 3.0))
    (effect,) = answer.effects
    assert (effect.place, effect.effect) == ("load:V1", "step")
    assert effect.alternatives == (("valve:V1", "offset"),)
    assert effect.parameters["time"] == pytest.approx(430.0, abs=2.0)
    low, high = effect.intervals["size"]
    assert low <= 3.0 <= high
    assert effect.closed > 0.9
    assert effect.units["size"] == "%"


@pytest.mark.trial
@pytest.mark.parametrize(
    ("place", "effect"),
    [
        ("load:V1", SquareDisturbance(3.0, 83.0, 0.7)),
        ("disturbance:PV1", SquareDisturbance(0.8, 61.0, 2.0)),
        ("load:V1", TriangleDisturbance(4.0, 71.0, -1.0)),
    ],
)
def test_a_wave_is_named_by_shape_and_place(place: str, effect: Behaviour) -> None:
    answer = found(place, effect)
    assert [(e.place, e.effect) for e in answer.effects] == [(place, effect.effect)]
    own = effect.to_mapping()
    assert answer.effects[0].parameters["period"] == pytest.approx(own["period"], rel=0.01)
    assert answer.effects[0].parameters["amplitude"] == pytest.approx(own["amplitude"], rel=0.1)


@pytest.mark.trial
def test_a_sine_is_the_same_wherever_it_enters() -> None:
    answer = found("load:V1", SineDisturbance(3.0, 57.0))
    (effect,) = answer.effects
    names = {(effect.place, effect.effect), *effect.alternatives}
    assert names == {("disturbance:PV1", "sine"), ("load:V1", "sine")}


def test_the_response_to_a_load_is_that_of_its_stem() -> None:
    run = FreeRun(loop(), open_gate(loop(), [record(loop(), samples=300)])[0])
    candidate = StepCandidate.of(run, LOAD, 0, np.zeros(0))
    response = candidate.respond(run, np.array([[120.0]]))
    moved = FreeRun(loop().with_effect("load:V1", StepDisturbance(120.0, 2.5)), run.runs)
    assert 2.5 * response.sizes[0][:, 0, 0] == pytest.approx(
        moved.forced[:, 0] - run.forced[:, 0], abs=1e-9
    )


def test_every_place_has_its_shapes() -> None:
    run = FreeRun(loop(), open_gate(loop(), [record(loop(), samples=300)])[0])
    gap = np.random.default_rng(0).normal(size=(300, 1))
    names = {key for c in disturbance_candidates(run, gap, [gap[:, 0]]) for key in c.keys}
    shapes = ("step", "drift", "sine", "square", "triangle")
    assert {(place, shape) for place in ("load:V1", "disturbance:PV1") for shape in shapes} <= names


def test_what_samples_tell_of_a_frequency_grows_with_their_cube() -> None:
    """Laplace's approximation of a sine's evidence, which a frequency's share of BIC stands for."""
    counts, information = np.array([1000, 4000]), []
    for count in counts:
        time, step = np.arange(count) - 0.5 * count, 1e-6
        wave = [np.sin(2.0 * np.pi * (0.05 + shift) * time) for shift in (-step, step)]
        slope = (wave[1] - wave[0]) / (2.0 * step)
        information.append(float(slope @ slope))
    grown = np.log(information[1] / information[0]) / np.log(counts[1] / counts[0])
    assert grown == pytest.approx(A_FREQUENCY, abs=0.01)


@pytest.mark.parametrize("effect", ["sine", "square", "triangle"])
def test_a_wave_is_priced_by_its_frequency(effect: str) -> None:
    run = FreeRun(loop(), open_gate(loop(), [record(loop(), samples=300)])[0])
    found = disturbance_candidates(run, run.runs.pv - run.forced, [run.runs.pv[:, 0]])
    counts = {each.count(each.values(each.grid())[0]) for each in found if each.effect == effect}
    assert counts == {5}


def test_a_line_of_chance_is_no_wave() -> None:
    seen, _ = blind_loop(237, "single")
    answer = find_discrepancy(seen.model, [seen.record], QUICK)
    assert not answer.effects
    assert not answer.alternatives


@pytest.mark.trial
def test_an_effect_less_than_the_noise_of_the_equation_wanders_is_named() -> None:
    seen, _ = blind_loop(287, "single")
    answer = find_discrepancy(seen.model, [seen.record], QUICK)
    assert [each.effect for each in answer.effects] == ["characteristic"]
    assert answer.closed > 0.5  # the free run has a level of its own
