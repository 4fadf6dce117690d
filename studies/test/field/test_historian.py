"""What historians do to signals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_studies.field.historian import averaged, excepted, rounded, sampled, swinging_door

signals = st.lists(st.floats(-100.0, 100.0), min_size=3, max_size=80).map(np.array)


@given(values=signals, deadband=st.floats(0.01, 20.0), longest=st.integers(2, 30))
def test_reports_by_exception_stay_within_the_deadband(
    values: np.ndarray, deadband: float, longest: int
) -> None:
    kept = excepted(values, deadband, longest)
    assert np.abs(kept - values).max() <= deadband
    changes = np.flatnonzero(np.diff(kept)) + 1
    assert (kept[changes] == values[changes]).all()


@given(values=signals, deviation=st.floats(0.01, 20.0), longest=st.integers(2, 30))
def test_a_swinging_door_stays_near_the_signal(
    values: np.ndarray, deviation: float, longest: int
) -> None:
    kept = swinging_door(values, deviation, longest)
    assert len(kept) == len(values)
    # The line runs between two doors that all points passed, so at most twice the deviation.
    assert np.abs(kept - values).max() <= 2.0 * deviation + 1e-9
    assert kept[0] == values[0]
    assert kept[-1] == pytest.approx(values[-1])


def test_a_straight_line_is_two_points_to_a_swinging_door() -> None:
    bent = np.concatenate([np.arange(20.0), 19.0 - 2.0 * np.arange(1, 20)])
    assert swinging_door(bent, 0.01, 100) == pytest.approx(bent, abs=0.011)


def test_rounding_averaging_and_sampling() -> None:
    values = np.array([0.1, 0.26, 0.9, 1.1, 2.0, 9.0])
    assert rounded(values, 0.5) == pytest.approx([0.0, 0.5, 1.0, 1.0, 2.0, 9.0])
    assert averaged(values, 2) == pytest.approx([0.18, 1.0, 5.5])
    assert sampled(values, 4) == pytest.approx([0.1, 2.0])
