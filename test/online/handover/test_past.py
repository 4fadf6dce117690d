import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.handover.past import Past


@given(limit=st.integers(1, 9), samples=st.integers(0, 60), late=st.integers(0, 12))
def test_it_holds_the_last_samples_in_order(limit: int, samples: int, late: int) -> None:
    past = Past(limit, 1, 2, 0)
    for k in range(samples):
        past.add(np.array([k]), np.array([k, -k]), np.zeros(0))
    expected = list(range(max(samples - limit, 0), samples))
    assert past.count == samples
    assert len(past) == len(expected)
    assert past.history().op[:, 0].tolist() == expected
    assert past.history().pv[:, 1].tolist() == [-k for k in expected]
    since = max(samples - late, 0)
    assert past.since(since).op[:, 0].tolist() == [k for k in expected if k >= since]


def test_what_is_cleared_is_forgotten_and_the_count_goes_on() -> None:
    past = Past(3, 1, 1, 0)
    for k in range(5):
        past.add(np.array([k]), np.array([k]), np.zeros(0))
    past.clear()
    past.add(np.array([9.0]), np.array([9.0]), np.zeros(0))
    assert past.history().op.tolist() == [[9.0]]
    assert past.since(0).op.tolist() == [[9.0]]
    assert past.count == 6


def test_a_history_is_a_copy() -> None:
    past = Past(3, 1, 1, 0)
    past.add(np.zeros(1), np.zeros(1), np.zeros(0))
    past.history().op[:] = 7.0
    assert past.history().op.tolist() == [[0.0]]
