import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.plain_settings import FitSchedule

schedules = st.builds(FitSchedule, st.integers(1, 50), st.integers(1, 50), st.integers(1, 50))


@given(schedules)
def test_windows_end_where_the_docstring_says(schedule: FitSchedule) -> None:
    due = [k for k in range(300) if schedule.due(k)]
    assert due == list(range(schedule.fit_first - 1, 300, schedule.fit_every))


@given(schedules)
def test_every_fit_is_awaited_exactly_once(schedule: FitSchedule) -> None:
    awaited = [(k, schedule.awaited(k)) for k in range(400)]
    found = [(k, end) for k, end in awaited if end is not None]
    due = [k for k in range(400) if schedule.due(k)]
    expected = [(k + schedule.fit_latency, k) for k in due if k + schedule.fit_latency < 400]
    assert found == expected


def test_nothing_is_awaited_before_the_first_sample() -> None:
    assert FitSchedule(1, 1, 5).awaited(0) is None


@pytest.mark.parametrize("sample", [-5, -1])
def test_nothing_is_due_before_the_first_sample(sample: int) -> None:
    assert not FitSchedule(1, 1, 1).due(sample)
