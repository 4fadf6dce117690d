"""Counts of right answers, kept run by run."""

import dataclasses
from pathlib import Path

import pytest

from stiction_ros.errors import InputError
from stiction_studies.commands import choices
from stiction_studies.paper.settings import printed_example
from stiction_studies.paper.success import METHODS, RIGHT, Success, Trial, run_trial


def made(seed: int, error: float = 0.0, method: str = "grid", delay: int = 5) -> Trial:
    return Trial(1, method, seed, ((5.0, 2.0),), error, (delay,), 0.7, 1.5, 0, 0, 3916)


def test_a_run_at_the_paper_s_settings_is_judged_by_the_truth() -> None:
    trial = run_trial(2, "grid", 1)
    assert trial.friction == ((8.0, 1.0), (0.0, 0.0))
    assert trial.error == 0.0
    assert trial.right
    assert trial.points == 396
    assert trial.delays == (0, 0, 0, 0)


def test_runs_come_back_from_the_file(tmp_path: Path) -> None:
    path = tmp_path / "count.json"
    count = Success().with_trials([made(2), made(1)], "one").with_trials([made(3)], "two")
    count.save(path)
    assert Success.load(path) == count
    assert [trial.seed for trial in count.trials] == [1, 2, 3]
    assert count.commands == ("one", "two")


def test_the_newer_run_of_a_seed_stays() -> None:
    count = Success().with_trials([made(1, 9.0)], "a").with_trials([made(1)], "a")
    assert count.trials == (made(1),)
    assert count.commands == ("a",)


def test_rates_count_by_example_and_method() -> None:
    trials = [made(1), made(2, RIGHT), made(3, 0.16, delay=6), made(1, 1.0, "nlp")]
    nlp, grid = Success(tuple(trials)).rates()
    assert (nlp.method, nlp.right, nlp.total) == ("nlp", 0, 1)
    assert (grid.right, grid.total, grid.delay_right, grid.seeds) == (2, 3, 2, (1, 3))


@pytest.mark.parametrize("text", ["", "[]", '{"trials": [{}], "commands": []}'])
def test_another_file_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "count.json"
    path.write_text(text)
    with pytest.raises(InputError, match="holds no count"):
        Success.load(path)


def test_the_command_counts_all_methods() -> None:
    assert choices.COUNTED == METHODS


@pytest.mark.trial
def test_settings_of_the_examples_are_the_paper_s() -> None:
    one, two = printed_example(1), printed_example(2)
    assert (one.starts * one.choices, two.starts * two.choices) == (77, 5)
    options = one.options(dataclasses.replace(one.make(1)), "nlp")
    assert (options.output_order, options.input_order, options.friction_limit) == (3, 3, None)
    with pytest.raises(InputError):
        printed_example(3)
