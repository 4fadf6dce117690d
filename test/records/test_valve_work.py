import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.records.record import Quality, Record
from stiction_ros.records.valve_work import ValveWork, largest_op_step, work_per_hour


def record(stem: list[float], mask: list[int] | None = None) -> Record:
    column = np.array(stem)[:, None]
    quality = None if mask is None else np.array(mask, dtype=np.uint8)
    return Record("loop", 60.0, ("V1",), ("PV1",), column, column, None, column, mask=quality)


def test_a_stem_that_rests_does_nothing() -> None:
    assert ValveWork.of(np.full(9, 43.21)) == ValveWork(0.0, 0.0, 0.0)
    assert ValveWork.of(np.zeros(0)) == ValveWork(0.0, 0.0, 0.0)


def test_rounding_is_no_move() -> None:
    stem = np.array([50.0, 58.0, 58.0 + 1e-12, 50.0])
    found = ValveWork.of(stem)
    assert (found.moves, found.reversals) == (2.0, 1.0)
    assert found.travel == pytest.approx(16.0)


@given(st.lists(st.integers(-5, 5), min_size=1, max_size=40))
def test_the_way_is_the_sum_of_its_moves_and_at_least_the_distance(path: list[int]) -> None:
    stem = np.cumsum(path).astype(float)
    found = ValveWork.of(stem)
    steps = np.diff(stem)
    assert found.travel == np.abs(steps).sum() >= abs(stem[-1] - stem[0])
    assert found.moves == np.count_nonzero(steps)
    assert found.reversals == ValveWork.of(stem[::-1]).reversals <= max(found.moves - 1, 0)


def test_work_is_told_an_hour_and_by_valve() -> None:
    found = work_per_hour(record([50.0, 58.0] * 60))
    assert found == {"V1": ValveWork(119 * 8.0 / 2, 119 / 2, 118 / 2)}


def test_what_is_missing_counts_as_one_move() -> None:
    bad = [Quality.GOOD, Quality.BAD, Quality.GOOD, Quality.GOOD]
    one = record([50.0, 90.0, 55.0, 55.0], [int(q) for q in bad])
    assert work_per_hour(one)["V1"] == ValveWork(5.0, 1.0, 0.0).per_hour(4 / 60)
    assert largest_op_step(one) == {"V1": 5.0}


def test_without_stems_nothing_is_told() -> None:
    column = np.zeros((9, 1))
    assert work_per_hour(Record("loop", 1.0, ("V1",), ("PV1",), column, column)) == {}
