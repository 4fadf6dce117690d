"""Rows of LANES numbers do in every lane what numbers do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numba import TypingError

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.lanes import LANES, halves_swapped, put, row, spread, where_larger

ROWS = arrays(float, (3, LANES), elements=st.floats(-1e3, 1e3))


@compiled
def _combined(values: FloatArray, factor: float, out: FloatArray) -> None:
    one, two, three = row(values, 0), row(values, LANES), row(values, 2 * LANES)
    put(out, 0 * LANES, one + two)
    put(out, 1 * LANES, one - three)
    put(out, 2 * LANES, two * three)
    put(out, 3 * LANES, one / (three * three + spread(1.0)))
    put(out, 4 * LANES, factor * two)
    put(out, 5 * LANES, halves_swapped(one))
    put(out, 6 * LANES, where_larger(one, two, three, one))
    put(out, 7 * LANES, row(values, 3))


@given(values=ROWS, factor=st.floats(-10.0, 10.0))
def test_every_lane_is_computed_as_by_itself(values: FloatArray, factor: float) -> None:
    out = np.full((9, LANES), 7.0)
    _combined(values, factor, out)
    one, two, three = values
    expected = [one + two, one - three, two * three, one / (three * three + 1.0), factor * two]
    assert (out[:5] == np.array(expected)).all()
    assert (out[5] == np.roll(one, LANES // 2)).all()
    assert (out[6] == np.where(one > two, three, one)).all()
    assert (out[7] == values.ravel()[3 : 3 + LANES]).all()
    assert (out[8] == 7.0).all()


@compiled
def _running_sums(values: FloatArray) -> None:
    total = spread(0.0)
    for k in range(len(values)):
        total = total + row(values, LANES * k)
        put(values, LANES * k, total)


@pytest.mark.parametrize("count", [1, 2, 40])
def test_rows_are_carried_from_pass_to_pass(count: int) -> None:
    values = np.random.default_rng(count).standard_normal((count, LANES))
    expected = np.cumsum(values, axis=0)
    _running_sums(values)
    assert values == pytest.approx(expected, abs=1e-12)


def test_an_array_with_gaps_is_no_array_of_rows() -> None:
    with pytest.raises(TypingError):
        _running_sums(np.zeros((4, 2 * LANES))[:, ::2])
