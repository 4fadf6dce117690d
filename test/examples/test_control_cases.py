from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.examples.control_cases import (
    CASES,
    ControlOutcome,
    run_case,
    run_reference,
    run_unaware,
)


@pytest.fixture(scope="module")
def nominal() -> tuple[ControlOutcome, ControlOutcome, ControlOutcome]:
    case = CASES["nominal"]
    return run_case(case, 41), run_reference(case, 41), run_unaware(case, 41)


def test_the_embedding_is_about_as_good_as_without_stiction(
    nominal: tuple[ControlOutcome, ControlOutcome, ControlOutcome],
) -> None:
    embedding, free, unaware = nominal
    assert np.all(embedding.iae <= 1.25 * free.iae)
    assert np.all(unaware.iae >= 1.5 * free.iae)
    assert np.all(embedding.offset <= [0.008, 0.03])


def test_only_the_unaware_loop_cycles(
    nominal: tuple[ControlOutcome, ControlOutcome, ControlOutcome],
) -> None:
    embedding, _, unaware = nominal
    late = [np.std(run.error[260:], axis=0)[0] for run in (embedding, unaware)]
    assert late[0] < 0.7 * late[1]


def test_the_same_seed_gives_the_same_run(
    nominal: tuple[ControlOutcome, ControlOutcome, ControlOutcome],
) -> None:
    again = run_case(CASES["nominal"], 41)
    assert np.array_equal(again.error, nominal[0].error)


def test_the_slip_check_holds_a_loop_whose_static_friction_is_half_as_large_again() -> None:
    case = CASES["true_50_more"]
    with_check, without = run_case(case, 41), run_case(case, 41, {"slip_check": False})
    assert with_check.iae[0] < 0.6 * without.iae[0]
    assert with_check.late_turns < without.late_turns


def test_an_input_that_the_tank_does_not_have_is_refused() -> None:
    case = dataclasses.replace(CASES["C_B"], upset=("C_X", 0.0, 1.0))
    with pytest.raises(InputError):
        run_case(case, 41)
