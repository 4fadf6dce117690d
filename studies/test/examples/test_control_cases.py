import dataclasses

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_studies.examples import control_cases
from stiction_studies.examples.control_cases import (
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


@pytest.mark.trial
@pytest.mark.parametrize("mode", ["embedding", "unaware"])
def test_a_soft_bound_of_c_stops_the_loop_short_of_a_set_point_beyond_it(
    mode: str,
    nominal: tuple[ControlOutcome, ControlOutcome, ControlOutcome],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The set-point of C is 7.41 from sample 150 on; Table A.3 allows 0, this controller 7.46."""
    monkeypatch.setattr(control_cases, "SAMPLES", 165)
    bounded = run_case(CASES["nominal"], 41, {"mode": mode, "pv_low": (7.46, 0.0)})
    free = nominal[0] if mode == "embedding" else nominal[2]
    late = slice(158, 165)
    lowest, apart = (float(np.min(run.error[late, 0] + run.sp[late, 0])) for run in (bounded, free))
    assert bounded.sp[late, 0].max() == 7.41
    assert lowest > 7.445
    assert apart < 7.42


@pytest.mark.trial
def test_waiting_for_the_end_of_an_unmeasured_step_spares_moves() -> None:
    at_once, waiting = (
        [run_case(CASES["C_B"], seed, {"longest_wait": longest}) for seed in (41, 42)]
        for longest in (0, 20)
    )
    assert sum(run.moves for run in waiting) < 0.8 * sum(run.moves for run in at_once)
    assert sum(run.travel for run in waiting) < 0.85 * sum(run.travel for run in at_once)
    assert max(run.offset[0] for run in waiting) < 0.006


def test_only_the_unaware_loop_cycles(
    nominal: tuple[ControlOutcome, ControlOutcome, ControlOutcome],
) -> None:
    embedding, _, unaware = nominal
    late = [np.std(run.error[260:], axis=0)[0] for run in (embedding, unaware)]
    assert late[0] < 0.7 * late[1]


@pytest.mark.trial
def test_the_same_seed_gives_the_same_run(
    nominal: tuple[ControlOutcome, ControlOutcome, ControlOutcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(control_cases, "SAMPLES", 320)
    again = run_case(CASES["nominal"], 41)
    assert np.array_equal(again.error, nominal[0].error[:320])


@pytest.mark.trial
def test_the_slip_check_holds_a_loop_whose_static_friction_is_half_as_large_again() -> None:
    case = CASES["true_50_more"]
    with_check, without = run_case(case, 41), run_case(case, 41, {"slip_check": False})
    assert with_check.iae[0] < 0.6 * without.iae[0]
    assert with_check.late_turns < without.late_turns


def test_an_input_that_the_tank_does_not_have_is_refused() -> None:
    case = dataclasses.replace(CASES["C_B"], upset=("C_X", 0.0, 1.0))
    with pytest.raises(InputError):
        run_case(case, 41)
