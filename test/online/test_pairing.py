"""Pairing of PV and OP by stamp."""

from __future__ import annotations

import numpy as np
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
    assert all(s.op == s.pv == s.sample and s.missed == 0 for s in found)


def test_a_pv_without_op_takes_the_op_that_was_held():
    pairing = Pairing(1.0)
    pairing.add_pv(0, value(0))
    pairing.add_op(0, value(7))
    pairing.add_pv(SECOND, value(1))
    pairing.add_pv(2 * SECOND, value(2))
    found = pairing.add_op(2 * SECOND, value(9))
    assert [(s.sample, float(s.op[0])) for s in found] == [(1, 7.0), (2, 9.0)]


def test_missed_samples_are_counted():
    pairing = Pairing(1.0)
    pairing.add_pv(0, value(0))
    pairing.add_op(0, value(0))
    pairing.add_pv(4 * SECOND, value(4))
    (found,) = pairing.add_op(4 * SECOND, value(4))
    assert (found.sample, found.missed) == (4, 3)


def test_pv_alone_does_not_pile_up():
    pairing = Pairing(1.0)
    for k in range(UNPAIRED + 100):
        assert pairing.add_pv(k * SECOND, value(k)) == []
    assert len(pairing._pv) == UNPAIRED
