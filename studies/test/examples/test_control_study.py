"""The runs of `stiction demo tank --compare`, short ones."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.paper.controllers.weights import WeightPreset
from stiction_studies.examples.control_study import (
    COLUMNS,
    REACH,
    StudyOptions,
    Trial,
    held_out_set_points,
    run_trial,
)

SHORT = StudyOptions(plant="linear", hold=40)
START = np.array([7.5, 42.324])


@pytest.fixture(scope="module")
def trial() -> Trial:
    return run_trial(SHORT, 5)


@pytest.mark.trial
def test_every_column_has_the_same_set_points(trial: Trial) -> None:
    first = trial.runs["free"].run.record.sp
    assert all(np.array_equal(run.run.record.sp, first) for run in trial.runs.values())  # type: ignore[arg-type]


@pytest.mark.trial
def test_every_column_has_the_same_noise(trial: Trial) -> None:
    noises = [run.run.record.pv - run.run.pv_clean for run in trial.runs.values()]
    assert all(noise == pytest.approx(noises[0], abs=1e-9) for noise in noises)


@pytest.mark.trial
@pytest.mark.parametrize("column", COLUMNS, ids=lambda column: column.key)
def test_the_valve_sticks_where_it_should(trial: Trial, column: Any) -> None:
    record = trial.runs[column.key].run.record
    assert record.stem is not None
    friction = HeStiction(8.0, 1.0) if column.sticky else HeStiction(0.0, 0.0)
    stem = friction.simulate(record.op[:, 0], start=50.0)
    assert record.stem[:, 0] == pytest.approx(stem)
    assert record.stem[:, 1] == pytest.approx(record.op[:, 1])


@pytest.mark.trial
def test_choices_are_counted_for_the_embedding_as_printed(trial: Trial) -> None:
    samples = len(trial.runs["printed"].run.record)
    assert len(trial.runs["printed"].from_start) == samples
    assert trial.runs["exact"].from_start == ()


@pytest.mark.trial
def test_all_steps_are_solved(trial: Trial) -> None:
    for run in trial.runs.values():
        assert run.statuses == {"solved": len(run.run.record)}


@pytest.mark.trial
def test_a_preset_changes_the_unaware_controller_alone() -> None:
    chosen = [column for column in COLUMNS if column.key in ("unaware", "exact")]
    own = run_trial(SHORT, 5, columns=chosen)
    printed = run_trial(StudyOptions("linear", WeightPreset.PRINTED, hold=40), 5, columns=chosen)
    same = {
        key: np.array_equal(own.runs[key].run.record.op, printed.runs[key].run.record.op)
        for key in own.runs
    }
    assert same == {"unaware": False, "exact": True}


@pytest.mark.trial
def test_the_scenario_s_own_set_points_last_one_round() -> None:
    found = run_trial(StudyOptions(schedule="scenario"), 5, columns=COLUMNS[:1])
    run = found.runs["unaware"].run
    assert len(run.record) == 620
    assert run.record.sp is not None
    assert run.record.sp[-1].tolist() == [7.38, 41.0]


@given(seed=st.integers(0, 10_000), hold=st.integers(40, 500))
def test_held_out_moves_are_small_enough_and_large_enough(seed: int, hold: int) -> None:
    found = held_out_set_points(("C", "T"), START, 60.0, hold, seed)
    moves = np.abs(np.diff(found.values, axis=0)) / REACH
    assert np.all(np.abs(found.values - START) <= np.array(REACH) + 1e-12)
    assert np.all((moves == 0.0) | (moves >= 0.2 - 1e-12))
    assert np.all(moves[0] > 0.0)
    assert np.all(moves.max(axis=1) > 0.0)
    assert np.diff(found.times[1:]).tolist() == [60.0 * hold] * 4


def test_held_out_moves_belong_to_their_seed() -> None:
    first, again, other = (
        held_out_set_points(("C", "T"), START, 60.0, 120, seed).values for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize(
    ("values", "where"),
    [({"plant": "boiler"}, "plant"), ({"schedule": "mine"}, "schedule"), ({"hold": 39}, "hold")],
)
def test_options_that_mean_nothing_are_refused(values: dict[str, Any], where: str) -> None:
    with pytest.raises(InputError) as caught:
        StudyOptions(**values)
    assert (caught.value.where, bool(caught.value.fix)) == (where, True)
