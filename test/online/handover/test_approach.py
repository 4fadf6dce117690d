import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.handover.approach import Approach

VALUES = st.floats(-1e3, 1e3)


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
