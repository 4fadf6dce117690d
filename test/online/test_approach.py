from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.approach import Approach

VALUES = st.floats(-1e3, 1e3)


@given(pv=VALUES, sp=VALUES, samples=st.integers(0, 30))
def test_it_goes_from_pv_to_the_set_point_in_equal_steps(
    pv: float, sp: float, samples: int
) -> None:
    approach = Approach()
    aims = [
        float(approach.aim(np.array([pv]), np.array([sp]), samples)[0]) for _ in range(samples + 2)
    ]
    assert aims[samples:] == [sp] * 2
    steps = np.diff([pv, *aims[: samples + 1]])
    assert steps == pytest.approx([(sp - pv) / (samples + 1)] * (samples + 1), abs=1e-9)


def test_it_begins_with_the_first_measurement() -> None:
    approach, sp = Approach(), np.array([5.0])
    assert approach.aim(np.array([np.nan]), sp, 4) is sp
    assert approach.aim(np.array([0.0]), sp, 4).tolist() == [1.0]


def test_a_set_point_that_moves_on_the_way_moves_the_aim() -> None:
    approach = Approach()
    approach.aim(np.array([0.0]), np.array([10.0]), 4)
    assert approach.aim(np.array([0.0]), np.array([20.0]), 4).tolist() == [14.0]


def test_when_it_is_over_the_set_point_itself_is_given() -> None:
    approach, sp = Approach(), np.array([5.0])
    for _ in range(3):
        approach.aim(np.array([0.0]), sp, 3)
    assert approach.aim(np.array([0.0]), sp, 3) is sp
