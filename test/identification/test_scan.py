"""The scan equals plain least squares, whatever the prefilter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.identification.output_error import Orders
from stiction_ros.identification.scan import OutputScan


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1000), na=st.integers(1, 3), nb=st.integers(1, 3))
def test_one_step_criterion_is_the_least_squares_one(seed: int, na: int, nb: int) -> None:
    generator = np.random.default_rng(seed)
    y = generator.standard_normal(200)
    stems = generator.standard_normal((3, 200)).cumsum(axis=1)
    orders = Orders(na, nb, 2, 20)
    one = np.ones(1)
    scan = OutputScan(y, np.empty((0, 200)), (), orders, (0, 4), one, one)
    loss = scan.loss(stems)
    for g in range(3):
        for delay in range(5):
            columns = [y[20 - i : 200 - i] for i in range(1, na + 1)]
            columns += [stems[g, 20 - delay - i : 200 - delay - i] for i in range(1, nb + 1)]
            matrix = np.column_stack([*columns, np.ones(180)])
            rest = y[20:] - matrix @ np.linalg.lstsq(matrix, y[20:], rcond=None)[0]
            expected = 180 * np.log(rest @ rest / 180)
            assert loss[g, delay] == pytest.approx(expected, abs=1e-4)
