"""Whether PV repeats itself, and whether it answers its valve at all."""

import dataclasses

import numpy as np
import pytest
from evidence_loops import FloatArray, pi_loop

from stiction_ros.identification import Identification, identify
from stiction_ros.identification.evidence.candidate import Candidate, ideal
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.measured_figures import SHORTEST, echo
from stiction_ros.records.record import Record

SAMPLES = 1200
ECHO = 25.0  # white noise exceeds 20 at the most of a thousand lags in one record of 250


def irregular(samples: int, *, seed: int, length: int = 60) -> FloatArray:
    """Return a square wave whose half turns last three samples more or less."""
    random = np.random.default_rng(seed)
    halves = np.rint(random.normal(0.5 * length, 1.5, 9 + 2 * samples // length)).astype(int)
    signs = np.where(np.arange(len(halves)) % 2, 1.0, -1.0)
    return np.repeat(signs, np.maximum(halves, 1))[:samples]


def beside(record: Record, wave: FloatArray) -> Record:
    """Return the record with a wave in PV that the controller has not answered."""
    return dataclasses.replace(record, pv=record.pv + wave[:, None])


@pytest.mark.parametrize("seed", range(6))
def test_white_noise_does_not_repeat_itself(seed: int) -> None:
    problem = Problem.of(pi_loop(0.0, 0.0, seed=seed, samples=SAMPLES, noise=0.1))
    assert echo(problem, ideal(problem)) < ECHO


@pytest.mark.parametrize("seed", range(6))
def test_a_valve_that_sticks_leaves_nothing_that_repeats_itself(seed: int) -> None:
    record = pi_loop(3.0, 1.0, seed=seed, samples=SAMPLES, noise=0.1)
    problem = Problem.of(record)
    assert echo(problem, ideal(problem)) < ECHO


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("length", [24, 60, 110])
def test_a_wave_that_keeps_no_exact_time_does(seed: int, length: int) -> None:
    wave = 0.4 * irregular(SAMPLES, seed=seed, length=length)
    record = beside(pi_loop(0.0, 0.0, seed=seed, samples=SAMPLES), wave)
    problem = Problem.of(record)
    assert echo(problem, ideal(problem)) > ECHO


def test_the_strongest_of_all_outputs_counts() -> None:
    problem = Problem.of(beside(pi_loop(0.0, 0.0), 0.4 * irregular(700, seed=1)))
    one = ideal(problem)
    quiet = dataclasses.replace(one.fits[0], rest=np.random.default_rng(0).normal(size=700))
    both = dataclasses.replace(one, fits=(quiet, *one.fits))
    assert echo(problem, both) == echo(problem, one)


def test_a_record_without_room_for_a_turn_has_none() -> None:
    record = pi_loop(0.0, 0.0, samples=4 * SHORTEST)
    problem = Problem.of(record)
    noise = np.ones(1)
    fit = dataclasses.replace(ideal(problem).fits[0], noise=noise, rest=np.ones(len(record)))
    nothing = np.zeros((1, 2))
    candidate = Candidate(nothing, nothing[:, 0], problem.ideal_stems(), (fit,))
    assert echo(problem, candidate) == 0.0


def stuck(seed: int) -> Identification:
    """Return what is identified of a loop whose OP wanders while PV is noise of its own."""
    random = np.random.default_rng(seed)
    op = 50.0 + np.cumsum(random.standard_normal(900))
    pv = np.convolve(random.standard_normal(900), 0.8 ** np.arange(30), "same")
    return identify(Record("stuck", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None]))


def test_a_stem_that_never_moves_is_named() -> None:
    valve = stuck(3).valves[0]
    assert not valve.responds
    assert not valve.verdict.has_friction
    assert valve.to_dict()["responds"] is False
    assert valve.experiment.startswith("PV does not answer OP of V1: the stem is stuck")


@pytest.mark.trial
def test_a_pv_that_answers_is_told_so() -> None:
    for record in (pi_loop(0.0, 0.0, samples=900), pi_loop(3.0, 1.0, samples=900)):
        assert identify(dataclasses.replace(record, name="loop")).valves[0].responds
