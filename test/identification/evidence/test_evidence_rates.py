from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from evidence_loops import pi_loop

from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.evidence.accepted import Accepted
from stiction_ros.identification.evidence.engine import PRICE
from stiction_ros.identification.evidence.problem import Problem
from stiction_ros.identification.evidence.rates import ALIKE, Agreement, Look, agreement, looks
from stiction_ros.identification.evidence.search import search


@pytest.fixture(scope="module")
def seen() -> tuple[Look, ...]:
    return looks(pi_loop(3.0, 1.0), IdentificationOptions())


def changed(seen: tuple[Look, ...], *told: tuple[float, float, float]) -> tuple[Look, ...]:
    """Return looks that say (gain, least band, largest band) instead."""
    out = []
    for look, (gain, low, high) in zip(seen, told, strict=False):
        held = dataclasses.replace(look.accepted[0], gain=gain, band=(low, high))
        out.append(dataclasses.replace(look, accepted=(held,)))
    return tuple(out)


def rate_of(found: Agreement) -> int:
    return found.look.problem.rate


def test_there_is_a_look_for_each_rate_that_leaves_rows_enough(seen: tuple[Look, ...]) -> None:
    assert [look.problem.rate for look in seen] == [1, 2, 4]
    held = [look.accepted[0] for look in seen]
    assert all(one.gain > 50.0 for one in held)
    assert [one.band for one in held] == [pytest.approx((4.0, 4.0), abs=0.1)] * 3


def test_rates_hand_each_other_what_they_found() -> None:
    record = pi_loop(3.0, 1.0, samples=1600, noise=0.1)
    options = IdentificationOptions()
    alone = search(Problem.of(record)).best
    (first, *_) = looks(record, options)
    assert first.found.best.loss < alone.loss - 100.0
    assert first.found.best.friction[0] == pytest.approx([3.0, 1.0], abs=0.1)


def test_the_pair_with_the_larger_lesser_gain_is_taken(seen: tuple[Look, ...]) -> None:
    found = agreement(changed(seen, (2.0, 1.0, 2.0), (40.0, 1.0, 2.0), (30.0, 1.0, 2.0)), 0)
    assert (found.gain, found.alike, rate_of(found)) == (30.0, True, 2)


def test_one_rate_alone_shows_nothing(seen: tuple[Look, ...]) -> None:
    found = agreement(changed(seen, (300.0, 1.0, 2.0), (1.0, 1.0, 2.0), (0.5, 1.0, 2.0)), 0)
    assert found.gain == 1.0


def test_bands_far_apart_do_not_agree_however_large_the_gains(seen: tuple[Look, ...]) -> None:
    far = 1.01 * ALIKE
    found = agreement(changed(seen, (90.0, far, 2.0), (80.0, 0.5, 1.0)), 0)
    assert not found.alike
    near = agreement(changed(seen, (90.0, 0.99 * ALIKE, 2.0), (80.0, 0.5, 1.0)), 0)
    assert near.alike


def test_a_short_record_has_one_look_and_its_word_counts(seen: tuple[Look, ...]) -> None:
    short = looks(pi_loop(3.0, 1.0, samples=200), IdentificationOptions())
    found = agreement(short, 0)
    assert len(short) == 1
    assert found.gain == short[0].accepted[0].gain


def test_what_a_valve_gains_is_told_beside_the_friction_of_the_others() -> None:
    one, two = pi_loop(3.0, 1.0, seed=3), pi_loop(0.0, 0.0, seed=4)
    both = dataclasses.replace(
        one,
        valves=("V1", "V2"),
        outputs=("PV1", "PV2"),
        op=np.hstack([one.op, two.op]),
        pv=np.hstack([one.pv, two.pv]),
        sp=None,
    )
    seen = looks(both.part(0, 400), IdentificationOptions())
    sticky, ideal = (agreement(seen, valve).gain for valve in (0, 1))
    assert sticky > 100.0 > PRICE > ideal


def test_gains_are_none_below_what_stands_without(seen: tuple[Look, ...]) -> None:
    held: Accepted = seen[0].accepted[0]
    assert held.gain == pytest.approx(seen[0].found.ideal.loss - seen[0].found.best.loss)
