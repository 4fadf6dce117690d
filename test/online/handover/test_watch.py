import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.handover.watch import Approach, Watch, WatchRule

RULE = WatchRule(watch_samples=20, watch_settle=5, watch_ratio=1.5, watch_failures=3)
VALUES = st.floats(-1e3, 1e3)


def feed(watch: Watch, error: float, samples: int, sp: float = 0.0, failed: bool = False) -> str:
    """Feed a constant error; return the first verdict that is not empty."""
    for _ in range(samples):
        watch.add(np.array([sp + error]), np.array([sp]), failed)
        if said := watch.verdict():
            return said
    return ""


def swapped(error: float = 1.0, rule: WatchRule = RULE) -> Watch:
    watch = Watch(rule)
    feed(watch, error, 60)
    watch.begin()
    return watch


def test_before_a_swap_nothing_is_judged() -> None:
    watch = Watch(RULE)
    assert feed(watch, 1.0, 50) == ""
    assert feed(watch, 100.0, 50, failed=True) == ""


def test_a_worse_controller_is_found_out_when_the_samples_are_in() -> None:
    watch = swapped()
    assert feed(watch, 2.0, 19) == ""
    said = feed(watch, 2.0, 1)
    assert "2" in said
    assert "1" in said


@pytest.mark.parametrize("error", [0.0, 0.5, 1.0, 1.49])
def test_a_controller_that_is_not_much_worse_stays(error: float) -> None:
    assert feed(swapped(), error, 100) == ""


def test_it_is_judged_once() -> None:
    watch = swapped()
    assert feed(watch, 1.0, 30) == ""
    assert feed(watch, 50.0, 100) == ""


def test_failed_steps_are_found_out_at_once() -> None:
    watch = swapped()
    assert feed(watch, 0.0, 3, failed=True) == ""
    assert "4 failed steps" in feed(watch, 0.0, 1, failed=True)


def test_failed_steps_before_the_swap_do_not_count() -> None:
    watch = Watch(RULE)
    feed(watch, 1.0, 40, failed=True)
    watch.begin()
    assert feed(watch, 1.0, 30) == ""


def test_a_set_point_move_after_the_swap_is_no_reason() -> None:
    watch = swapped()
    assert feed(watch, 50.0, 5, sp=10.0) == ""
    assert feed(watch, 1.0, 30, sp=10.0) == ""


def test_a_set_point_move_before_the_swap_does_not_excuse_a_worse_controller() -> None:
    watch = Watch(RULE)
    feed(watch, 1.0, 40)
    feed(watch, 50.0, 5, sp=10.0)
    feed(watch, 1.0, 5, sp=10.0)
    watch.begin()
    assert feed(watch, 2.0, 30, sp=10.0) != ""


def test_one_output_that_is_worse_is_enough() -> None:
    watch = Watch(RULE)
    for _ in range(40):
        watch.add(np.array([1.0, 1.0]), np.zeros(2), False)
    watch.begin()
    said = ""
    for _ in range(30):
        watch.add(np.array([0.1, 2.0]), np.zeros(2), False)
        said = said or watch.verdict()
    assert said


def test_without_samples_from_before_only_failures_count() -> None:
    watch = Watch(RULE)
    watch.begin()
    assert feed(watch, 1e6, 40) == ""


def test_zero_samples_never_judge() -> None:
    watch = swapped(rule=WatchRule(watch_samples=0))
    assert feed(watch, 1e6, 200, failed=True) == ""


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_sample_that_is_no_number_hides_nothing(when: str) -> None:
    watch = Watch(RULE)
    feed(watch, 1.0, 40)
    if when == "before":
        feed(watch, np.nan, 1)
    feed(watch, 1.0, 2)
    watch.begin()
    if when == "after":
        feed(watch, np.nan, 1)
    assert feed(watch, 5.0, 40) != ""


def test_samples_behind_one_without_a_measurement_are_left_out() -> None:
    watch = swapped()
    for _ in range(60):
        watch.add(np.array([np.nan]), np.array([0.0]), True)
        for _ in range(RULE.watch_settle):
            watch.add(np.array([9.0]), np.array([0.0]), False)
        assert watch.verdict() == ""
    assert feed(watch, 1.0, 40) == ""


def test_after_a_change_of_the_valve_only_the_samples_since_are_the_reference() -> None:
    for last, worse in ((0, True), (20, False)):
        watch = Watch(RULE)
        feed(watch, 1.0, 60)
        feed(watch, 3.0, 20)
        watch.begin(last)
        assert bool(feed(watch, 3.0, 20)) == worse


def test_what_is_taken_while_one_is_on_trial_is_held_against_the_time_before_both() -> None:
    watch = swapped()
    feed(watch, 5.0, 10)
    watch.begin()
    assert feed(watch, 5.0, 20)


def test_samples_behind_a_disturbance_are_left_out() -> None:
    watch = swapped()
    for _ in range(20):
        watch.disturb()
        assert feed(watch, 9.0, RULE.watch_settle) == ""


@given(pv=VALUES, sp=VALUES, samples=st.integers(0, 30))
def test_it_goes_from_pv_to_the_set_point_in_equal_steps(
    pv: float, sp: float, samples: int
) -> None:
    approach, aims = Approach(np.array([pv]), np.array([sp]), samples), [pv]
    while not approach.over:
        aims.append(float(approach.aim(np.array([sp]))[0]))
    assert len(aims) == samples + 1
    assert approach.aim(np.array([sp])).tolist() == [sp]
    assert np.diff([*aims, sp]) == pytest.approx(
        [(sp - pv) / (samples + 1)] * (samples + 1), abs=1e-9
    )


def test_a_set_point_that_moves_on_the_way_moves_the_aim() -> None:
    approach = Approach(np.array([0.0]), np.array([10.0]), 4)
    approach.aim(np.array([10.0]))
    assert approach.aim(np.array([20.0])).tolist() == [14.0]
