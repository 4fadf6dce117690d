"""Rows of LANES numbers do in every lane what numbers do."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numba import TypingError

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.lanes import LANES, halves_swapped, put, row, spread

ROWS = arrays(float, (3, LANES), elements=st.floats(-1e3, 1e3))


@compiled
def _combined(values: FloatArray, factor: float, out: FloatArray) -> None:
    one, two, three = row(values, 0), row(values, 1), row(values, 2)
    put(out, 0, one + two)
    put(out, 1, one - three)
    put(out, 2, two * three)
    put(out, 3, one / (three * three + spread(1.0)))
    put(out, 4, factor * two)
    put(out, 5, halves_swapped(one))


@settings(max_examples=30, deadline=None)
@given(values=ROWS, factor=st.floats(-10.0, 10.0))
def test_every_lane_is_computed_as_by_itself(values: FloatArray, factor: float) -> None:
    out = np.full((7, LANES), 7.0)
    _combined(values, factor, out)
    one, two, three = values
    expected = [one + two, one - three, two * three, one / (three * three + 1.0), factor * two]
    assert (out[:5] == np.array(expected)).all()
    assert (out[5] == np.roll(one, LANES // 2)).all()
    assert (out[6] == 7.0).all()


@compiled
def _running_sums(values: FloatArray) -> None:
    total = spread(0.0)
    for k in range(len(values)):
        total = total + row(values, k)
        put(values, k, total)


@pytest.mark.parametrize("count", [1, 2, 40])
def test_rows_are_carried_from_pass_to_pass(count: int) -> None:
    values = np.random.default_rng(count).standard_normal((count, LANES))
    expected = np.cumsum(values, axis=0)
    _running_sums(values)
    assert values == pytest.approx(expected, abs=1e-12)


def test_an_array_with_gaps_is_no_array_of_rows() -> None:
    with pytest.raises(TypingError):
        _running_sums(np.zeros((4, 2 * LANES))[:, ::2])
