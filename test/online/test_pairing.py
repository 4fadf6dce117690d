"""Pairing of PV and OP by stamp."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.pairing import UNPAIRED, Pairing

SECOND = 10**9


def value(number: float) -> np.ndarray:
    return np.array([float(number)])


@given(st.permutations([(kind, k) for kind in ("pv", "op") for k in range(5)]))
def test_samples_come_out_in_order_and_once_whatever_comes_first(arrivals):
    pairing = Pairing(1.0)
    pairing.add_pv(0, value(-1))
    pairing.add_op(0, value(-1))
    found = []
    for kind, k in arrivals:
        add = pairing.add_pv if kind == "pv" else pairing.add_op
        found += add((k + 1) * SECOND, value(k))
    numbers = [sample.sample for sample in found]
    assert numbers == sorted(set(numbers))


@given(st.lists(st.sampled_from(["pv first", "op first"]), min_size=1, max_size=20))
def test_in_order_streams_lose_nothing(orders):
    pairing = Pairing(1.0)
    found = pairing.add_pv(0, value(0)) + pairing.add_op(0, value(0))
    for k, order in enumerate(orders, start=1):
        first, second = pairing.add_pv, pairing.add_op
        if order == "op first":
            first, second = second, first
        found += first(k * SECOND, value(k)) + second(k * SECOND, value(k))
    assert [s.sample for s in found] == list(range(len(orders) + 1))
    assert all(s.op == s.pv == s.sample for s in found)
    assert not +pairing.counts


def test_a_pv_without_op_takes_the_op_that_was_held():
    pairing = Pairing(1.0)
    pairing.add_pv(0, value(0))
    pairing.add_op(0, value(7))
    pairing.add_pv(SECOND, value(1))
    pairing.add_pv(2 * SECOND, value(2))
    found = pairing.add_op(2 * SECOND, value(9))
    assert [(s.sample, float(s.op[0])) for s in found] == [(1, 7.0), (2, 9.0)]


def test_samples_before_the_first_pv_of_a_run_are_not_missed():
    pairing = Pairing(1.0)
    pairing.origin = 0
    pairing.add_pv(4 * SECOND, value(4))
    (found,) = pairing.add_op(4 * SECOND, value(4))
    assert found.sample == 4
    assert not +pairing.counts


def test_pv_alone_does_not_pile_up():
    pairing = Pairing(1.0)
    for k in range(UNPAIRED + 100):
        assert pairing.add_pv(k * SECOND, value(k)) == []
    assert len(pairing._pv) == UNPAIRED


# ---- what the valves were given ----------------------------------------------------------------


def test_what_was_applied_counts_once_it_is_told():
    pairing = Pairing(1.0)
    pairing.add_pv(0, value(0))
    assert [float(s.op[0]) for s in pairing.add_op(0, value(7))] == [7.0]
    assert pairing.add_applied(SECOND, value(1)) == []
    assert pairing.add_op(2 * SECOND, value(9)) == []
    assert [float(s.op[0]) for s in pairing.add_pv(SECOND, value(1))] == [1.0]
    assert pairing.add_pv(2 * SECOND, value(2)) == []
    assert [float(s.op[0]) for s in pairing.add_applied(2 * SECOND, value(2))] == [2.0]


def test_the_op_before_the_run_holds_until_another_is_applied():
    pairing = Pairing(1.0)
    pairing.add_applied(-SECOND, value(50))
    pairing.add_pv(0, value(0))
    pairing.add_pv(SECOND, value(1))
    found = pairing.add_applied(SECOND, value(60))
    assert [(s.sample, float(s.op[0])) for s in found] == [(0, 50.0), (1, 60.0)]


# ---- streams with faults, as a table -----------------------------------------------------------


def stream(pairing, times, *, begin=0, nan=(), lost_op=()):
    """Feed PV = OP = time in s, PV first, and return what comes out."""
    found = []
    for time in times:
        stamp = begin + round(time * SECOND)
        found += pairing.add_pv(stamp, value(np.nan if time in nan else time))
        if time not in lost_op:
            found += pairing.add_applied(stamp, value(time))
    return found


@pytest.mark.parametrize(
    ("times", "nan", "counts", "bad"),
    [
        (range(10), (), {}, []),
        ([0, 1, 3, 4], (), {"missed": 1}, [2]),
        ([0, 1, 6, 7], (), {"missed": 4}, [2, 3, 4, 5]),
        (range(10), (4,), {"bad": 1}, [4]),
        ([0, 1, 4, 5, 6, 7], (4, 5), {"missed": 2, "bad": 2}, [2, 3, 4, 5]),
        (range(10), (0, 1), {"bad": 2}, [0, 1]),
        ([0, 0, 1, 1, 1, 2], (), {"repeated": 3}, []),
        ([0, 1.4, 1.6, 3], (), {"repeated": 1, "missed": 1}, [2]),
        ([0, 1, 2, -5, 3, 4], (), {"stale": 1}, []),
        ([0, 1, 2, 1e6, 3, 4], (), {"future": 1}, []),
        ([5, 6, 7, 0, 1, 2, 3, 8, 9], (), {"stale": 4}, []),
    ],
)
def test_what_becomes_of_a_stream(times, nan, counts, bad):
    pairing = Pairing(1.0)
    found = stream(pairing, times, nan=nan)
    assert +pairing.counts == counts
    numbers = [s.sample for s in found]
    assert numbers == sorted(set(numbers))
    first = pairing.stamp_of(0) / SECOND
    for one in found:
        if one.sample in bad:
            assert np.isnan(one.pv).all()
        else:
            assert one.pv[0] == pytest.approx(first + one.sample, abs=0.5)


def test_a_sample_that_lacks_keeps_the_op_that_was_given():
    pairing = Pairing(1.0)
    stream(pairing, [0, 1])
    pairing.add_applied(3 * SECOND, value(30))
    found = stream(pairing, [4])
    assert [(s.sample, float(s.op[0])) for s in found] == [(2, 1.0), (3, 30.0), (4, 4.0)]
    assert [np.isnan(s.pv[0]) for s in found] == [True, True, False]


def test_an_op_that_is_no_number_is_held_and_its_pv_kept():
    pairing = Pairing(1.0)
    stream(pairing, [0, 1])
    pairing.add_pv(2 * SECOND, value(7))
    found = pairing.add_applied(2 * SECOND, value(np.nan)) + stream(pairing, [3])
    assert [(float(s.pv[0]), float(s.op[0])) for s in found] == [(7.0, 1.0), (3.0, 3.0)]


@pytest.mark.parametrize(("older", "recognised"), [(9, False), (10, True), (30, True)])
def test_ten_rising_stamps_of_another_time_are_a_new_run(older, recognised):
    pairing = Pairing(1.0)
    stream(pairing, range(1000, 1050))
    found = stream(pairing, range(older))
    if not recognised:
        assert found == []
        assert [s.sample for s in stream(pairing, [1050])] == [50]
        return
    assert pairing.counts["runs"] == 1
    assert [s.sample for s in found] == list(range(50, 50 + older))
    assert [s.begins for s in found] == [True] + [False] * (older - 1)
    assert [float(s.pv[0]) for s in found] == list(range(older))
    assert pairing.stamp_of(50) == 0
    assert pairing.stamp_of(49) == 1049 * SECOND


def test_a_new_run_takes_over_the_op_that_was_in_force_before_it():
    pairing = Pairing(1.0)
    stream(pairing, range(1000, 1010))
    pairing.add_applied(-SECOND, value(77))
    found = stream(pairing, range(12), lost_op=(0,))
    assert [float(s.op[0]) for s in found] == [77.0, *range(1, 12)]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["pv", "op"]),
            st.integers(-(10**6), 10**6),
            st.sampled_from([0.0, np.nan, 1e9]),
        ),
        max_size=60,
    )
)
def test_no_junk_stops_what_comes_after_it(junk):
    pairing = Pairing(1.0)
    stream(pairing, range(5))
    for kind, seconds, number in junk:
        add = pairing.add_pv if kind == "pv" else pairing.add_applied
        add(seconds * SECOND, value(number))
    found = stream(pairing, range(2 * 10**6, 2 * 10**6 + 25))
    good = [s for s in found if np.isfinite(s.pv).all()]
    assert [float(s.pv[0]) for s in good[-10:]] == [2 * 10**6 + 15 + k for k in range(10)]


def test_when_op_applied_falls_silent_op_counts_again():
    pairing = Pairing(1.0)
    pairing.add_applied(-SECOND, value(0))
    found = []
    for k in range(60):
        found += pairing.add_pv(k * SECOND, value(k)) + pairing.add_op(k * SECOND, value(k))
    assert [s.sample for s in found][-20:] == list(range(40, 60))
    assert all(s.op == s.sample for s in found[-20:])
    pairing.add_applied(60 * SECOND, value(7))
    (last,) = pairing.add_pv(60 * SECOND, value(60))
    assert last.op == 7.0
