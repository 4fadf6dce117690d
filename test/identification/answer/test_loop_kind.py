"""What is known of a kind of loop, held against the process that was found."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.answer.loop_kind import EXPECTED, LoopKind, judged_by_kind
from stiction_ros.identification.answer.step_answer import StepAnswer

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
    found, sentence = judged_by_kind(LoopKind(kind), dataclasses.replace(FAST, lag=lag))
    assert found is agrees
    assert (f"no {kind} does" in sentence) is not agrees


def test_slow_sampling_contradicts_nothing() -> None:
    slow = dataclasses.replace(FAST, dead_time=0.0, lag=0.0, sample_time=10.0)
    assert judged_by_kind(LoopKind.TEMPERATURE, slow)[0] is None


@given(st.sampled_from(list(LoopKind)), st.floats(0.0, 1e6))
def test_one_stretch_of_lags_is_plausible(kind: LoopKind, lag: float) -> None:
    answer = dataclasses.replace(FAST, dead_time=0.0, lag=lag)
    inside = EXPECTED[kind].fastest <= lag <= EXPECTED[kind].slowest
    assert (judged_by_kind(kind, answer)[0] is True) is inside


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(InputError, match="unknown kind"):
        IdentificationOptions(kind="speed")
