"""What an undecided answer says would decide, and what is known of a kind of loop."""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions, VerdictKind
from stiction_ros.identification.answer import advice as module
from stiction_ros.identification.answer.advice import (
    EXPECTED,
    advised,
    experiment_for,
    sentence_by_kind,
)
from stiction_ros.identification.answer.step_answer import StepAnswer
from stiction_ros.identification.judgement import Figures, definitions
from stiction_ros.identification.result import FitStatus, Identification, OutputModel, ValveEstimate
from stiction_ros.records.record import Record


def undecided() -> ValveEstimate:
    return ValveEstimate(
        name="V1",
        verdict=VerdictKind.UNDECIDED,
        law="he",
        static_friction=1.0,
        static_interval=(0.0, 1.4),
        dynamic_friction=0.5,
        dynamic_interval=(0.0, 0.6),
        jump=0.5,
        stem_start=50.0,
        moves=40,
        evidence={},
    )


@pytest.fixture
def record() -> Record:
    random = np.random.default_rng(1)
    op = 60.0 + 4.0 * np.sin(np.arange(400) / 9.0)
    op *= 8.0 / np.ptp(op)
    pv = random.standard_normal(400)
    return Record("loop", 2.0, ("V1",), ("PV1",), op[:, None], pv[:, None])


def answer(
    valve: ValveEstimate, a: float = -0.9, noise: float = 0.01, method: str = "exact"
) -> Identification:
    model = OutputModel("PV1", (a,), {"V1": (0.1,)}, {"V1": 3}, 0.0, noise, 90.0, 80.0)
    return Identification(
        FitStatus.OK, "", method, 400, 2.0, 0.1, (valve,), (model,), np.zeros((400, 1))
    )


OPTIONS = IdentificationOptions()


@pytest.mark.parametrize(
    ("probability", "against", "said"),
    [
        (
            0.9,
            "loop_gone",
            "is likely (90 %) but not sure: the simulated loop moves nearly as much",
        ),
        (0.6, "repeats", "is likely (60 %) but not sure: PV also repeats itself one cycle later"),
        (0.4, "loop_gone", "does not rule out f_S up to 1.4 %, 18 % of OP's range"),
    ],
)
def test_the_reason_is_what_speaks_most_against(
    record: Record, monkeypatch: pytest.MonkeyPatch, probability: float, against: str, said: str
) -> None:
    odds = dict.fromkeys(definitions(), 1.0) | {against: -1.0}
    monkeypatch.setattr(module, "contributions", lambda figures: odds)
    figures = Figures(**dict.fromkeys(definitions(), 0.0))
    valve = dataclasses.replace(undecided(), probability=probability, figures=figures)
    assert said in experiment_for(record, answer(valve), 0)


def test_the_travel_test_is_sized_by_band_noise_and_process(record: Record) -> None:
    text = experiment_for(record, answer(undecided()), 0)
    figures = re.findall(r"by ([\d.]+) %.*of ([\d.]+) % held for (\d+) s", text)
    way, step, hold = map(float, figures[0])
    assert way == pytest.approx(2.0)  # largest f_S + f_D that is not rejected
    assert step == pytest.approx(0.5)
    assert hold == pytest.approx(2.0 * 4 + 3.0 * 18.0, abs=4.0)  # dead time and three lags


@pytest.mark.parametrize(
    ("noise", "step", "averaged", "times"),
    [
        (0.1, 0.5, 1, 1),
        (0.5, 0.5, 18, 1),  # four sigma over the answer of .95 × .5, squared
        (1.0, 1.0, 18, 1),
        (3.0, 2.0, 40, 1),
        (5.0, 2.0, 60, 2),
    ],
)
def test_noise_asks_for_longer_holds_then_larger_steps_then_repeats(
    record: Record, noise: float, step: float, averaged: int, times: int
) -> None:
    text = experiment_for(record, answer(undecided(), noise=noise), 0)
    found, hold = map(float, re.findall(r"steps of ([\d.]+) % held for (\d+) s", text)[0])
    assert found == pytest.approx(step)
    assert hold == pytest.approx(2.0 * 4 + 3.0 * 18.0 + 2.0 * (averaged - 1), abs=5.0)
    assert (f", {times} times over" in text) is (times > 1)


def test_an_integrator_is_told_by_its_slope(record: Record) -> None:
    text = experiment_for(record, answer(undecided(), a=-1.0), 0)
    assert "PV1 changes its slope at every step" in text


def test_only_undecided_valves_get_an_experiment(record: Record) -> None:
    for kind in VerdictKind:
        valve = dataclasses.replace(undecided(), verdict=kind)
        (told,) = advised(record, answer(valve), OPTIONS).valves
        assert bool(told.experiment) is (kind is VerdictKind.UNDECIDED)
        assert (told.to_dict()["experiment"] is None) is (kind is not VerdictKind.UNDECIDED)


@pytest.mark.parametrize(
    ("a", "lag"), [((-0.9,), 2.0 * 9), ((), 0.0), ((-1.0,), None), ((-1.05,), None)]
)
def test_the_answer_to_a_step(a: tuple[float, ...], lag: float | None) -> None:
    model = OutputModel("PV1", a, {"V1": (-0.2,)}, {"V1": 3}, 0.0, 0.1, 90.0, 80.0)
    found = StepAnswer.of(model, "V1", 400, 2.0)
    assert found.dead_time == 8.0
    assert found.lag == (None if lag is None else pytest.approx(lag, abs=2.0))
    assert found.after(6.0) == 0.0
    assert found.after(8.0) == pytest.approx(0.2)


def test_an_op_that_was_centred_has_its_mean_at_nothing() -> None:
    op = np.array([-1.0, 1.0, -1.0, 1.0]) + 4.05e-9
    assert module._middle(op) == 0.0
    assert module._middle(op + 40.0) == pytest.approx(40.0)


FAST = StepAnswer("PV1", 1.0, 4.0, np.ones(9), 0.1, 0.5)


@pytest.mark.parametrize(
    ("kind", "lag", "agrees"),
    [
        ("flow", 4.0, True),
        ("flow", 300.0, False),
        ("flow", None, False),
        ("pressure", 1.0, True),
        ("pressure", None, True),
        ("level", None, True),
        ("level", 2.0, False),
        ("temperature", 120.0, True),
        ("temperature", 1.0, False),
        ("temperature", 30_000.0, False),
        ("analyser", 900.0, True),
        ("analyser", 3.0, False),
    ],
)
def test_a_kind_speaks_for_or_against_a_process(kind: str, lag: float | None, agrees: bool) -> None:
    sentence = sentence_by_kind(kind, dataclasses.replace(FAST, lag=lag))
    assert sentence.endswith(f"as a {kind} may") is agrees
    assert (f"no {kind} does" in sentence) is not agrees


def test_slow_sampling_contradicts_nothing() -> None:
    slow = dataclasses.replace(FAST, dead_time=0.0, lag=0.0, sample_time=10.0)
    assert "do not tell" in sentence_by_kind("temperature", slow)


@given(st.sampled_from(list(EXPECTED)), st.floats(0.0, 1e6))
def test_one_stretch_of_lags_is_plausible(kind: str, lag: float) -> None:
    answer = dataclasses.replace(FAST, dead_time=0.0, lag=lag)
    inside = EXPECTED[kind].fastest <= lag <= EXPECTED[kind].slowest
    assert sentence_by_kind(kind, answer).endswith("may") is inside


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(InputError, match="unknown kind"):
        IdentificationOptions(kind="speed")
