import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.gain.measures import Yardstick
from stiction_ros.records.valve_work import ValveWork


def test_a_sine_has_its_amplitude_and_its_mean() -> None:
    error = 3.0 * np.sin(2 * np.pi * np.arange(2000) / 50.0)
    found = Yardstick(2.0, True, [(0, 2000)]).measure(error, np.zeros(2000))
    assert found.amplitude == pytest.approx(3.0, rel=1e-2)
    assert found.period == pytest.approx(100.0, rel=1e-2)
    assert found.iae_per_hour == pytest.approx(6.0 / math.pi, rel=1e-2)
    assert found.travel_per_hour == found.reversals_per_hour == 0.0


def test_travel_and_reversals_are_counted_an_hour() -> None:
    stem = np.tile([0.0, 1.0, 2.0, 1.0], 900)
    found = Yardstick(1.0, False, [(0, 3600)]).measure(np.zeros(3600), stem)
    assert found.amplitude is None
    assert found.period is None
    assert found.travel_per_hour == pytest.approx(3599.0)
    assert found.moves_per_hour == pytest.approx(3599.0)
    assert found.reversals_per_hour == pytest.approx(1799.0)


def test_a_faster_cycle_of_the_same_width_is_no_smaller() -> None:
    yardstick = Yardstick(1.0, True, [(0, 4000)])
    for turns in (50.0, 31.0):
        error = 2.0 * np.sin(2 * np.pi * np.arange(4000) / turns)
        found = yardstick.measure(error, np.zeros(4000))
        assert found.amplitude == pytest.approx(2.0, rel=1e-2)
        assert found.period == pytest.approx(turns, rel=1e-2)


@given(
    st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=50),
    st.floats(0.1, 10.0),
    st.floats(-9, 9),
)
def test_travel_grows_with_the_stem_and_knows_no_zero(
    path: list[float], factor: float, shift: float
) -> None:
    stem = np.array(path)
    work, again = ValveWork.of(stem), ValveWork.of(factor * stem + shift)
    near = pytest.approx(factor * work.travel, rel=1e-6, abs=1e-6 * (1 + abs(shift)))
    assert again.travel == near
    for one in (work, again):
        assert one.reversals <= one.moves <= len(path)
