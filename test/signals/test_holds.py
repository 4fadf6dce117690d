"""Stretches without a break."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.signals.holds import holds, set_point_moves, stretches


@given(st.lists(st.booleans(), max_size=30), st.data())
def test_stretches_cover_what_is_there_and_end_at_cuts(
    there: list[bool], data: st.DataObject
) -> None:
    cuts = data.draw(st.lists(st.integers(0, len(there)), max_size=4))
    begins, ends = stretches(np.array(there, dtype=bool), cuts)
    covered = [k for a, b in zip(begins, ends, strict=True) for k in range(a, b)]
    assert covered == [k for k, one in enumerate(there) if one]
    for a, b in zip(begins, ends, strict=True):
        assert not set(range(a + 1, b)) & set(cuts)
        assert a == 0 or a in cuts or not there[a - 1]
        assert b == len(there) or b in cuts or not there[b]


def test_a_set_point_rests_between_its_moves() -> None:
    sp = np.array([[1.0, 2.0], [1.0, 2.0], [1.0, 3.0], [4.0, 3.0]])
    assert set_point_moves(sp).tolist() == [2, 3]
    assert holds(sp) == [(0, 2), (2, 3), (3, 4)]
