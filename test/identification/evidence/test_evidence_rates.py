import dataclasses

import numpy as np
import pytest
from evidence_loops import pi_loop, slow_loop

from stiction_ros.identification import IdentificationOptions, identify
from stiction_ros.identification.closed_loop.tuning import Tuning
from stiction_ros.identification.evidence.accepted import Accepted
from stiction_ros.identification.evidence.candidate import ideal
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.rates import (
    ALIKE,
    BESIDE,
    INEXACT,
    PRICE,
    UNDIED,
    Agreement,
    Look,
    agreement,
    looks,
    samples_between_reports,
)
from stiction_ros.identification.evidence.search import Found, search, search_again


@pytest.fixture(scope="module")
def seen() -> tuple[Look, ...]:
    return looks(pi_loop(3.0, 1.0), IdentificationOptions())


def changed(seen: tuple[Look, ...], *told: tuple[float, float, float]) -> tuple[Look, ...]:
    """Return looks that say (gain, least band, largest band) instead."""
    out = []
    for look, (gain, low, high) in zip(seen, told, strict=False):
        held = dataclasses.replace(look.accepted[0], gain=gain, band=(low, high))
        out.append(ending(dataclasses.replace(look, accepted=(held,)), 0.0))
    return tuple(out)


def ending(look: Look, share: float, reset_times: float = np.inf) -> Look:
    """Return a look whose friction-free responses end with ``share`` of their largest tap.

    ``reset_times`` are three of its controller, samples.
    """
    none = look.found.without[0]
    taps = np.append(np.ones(none.fits[0].responses.shape[1] - 1), share)[None, :]
    fits = tuple(dataclasses.replace(fit, responses=taps) for fit in none.fits)
    without = (dataclasses.replace(none, fits=fits),)
    found = dataclasses.replace(look.found, without=without)
    problem = dataclasses.replace(look.problem, tunings=(Tuning(0, 1.0, reset_times),))
    return dataclasses.replace(look, problem=problem, found=found)


def test_a_response_that_ends_with_friction_is_enough_where_the_controller_is_as_fast(
    seen: tuple[Look, ...],
) -> None:
    look = seen[0]
    rows = look.problem.taps * look.problem.rate
    assert ending(look, 0.5, 0.99 * rows).covers(0)
    assert not ending(look, 0.5, 1.01 * rows).covers(0)
    unknown = ending(look, 0.5)
    problem = dataclasses.replace(unknown.problem, tunings=(None,))
    assert not dataclasses.replace(unknown, problem=problem).covers(0)


def rate_of(found: Agreement) -> int:
    return found.look.problem.rate


def test_there_is_a_look_for_each_rate_that_leaves_rows_enough(seen: tuple[Look, ...]) -> None:
    assert [look.problem.rate for look in seen] == [1, 2, 4]
    held = [look.accepted[0].times(float(look.problem.span[0])) for look in seen]
    assert all(one.gain > 50.0 for one in held)
    assert [one.band for one in held] == [pytest.approx((4.0, 4.0), abs=0.1)] * 3


def test_what_is_best_at_one_rate_is_tried_at_the_others() -> None:
    problem = Problem.of(pi_loop(3.0, 1.0, samples=1600, noise=0.1))
    free = ideal(problem)
    poor = Found(free, free, (free,), (free,))
    slow = search(Problem.of(pi_loop(3.0, 1.0, samples=1600, noise=0.1), rate=2))
    better = search_again(problem, poor, [slow.best])
    assert better.best.loss < poor.best.loss - 100.0
    assert better.best.friction[0] * problem.span[0] == pytest.approx([3.0, 1.0], abs=0.1)


def test_the_pair_with_the_larger_lesser_gain_is_taken(seen: tuple[Look, ...]) -> None:
    found = agreement(changed(seen, (2.0, 1.0, 2.0), (40.0, 1.0, 2.0), (30.0, 1.0, 2.0)), 0)
    assert (found.gain, found.alike, rate_of(found)) == (30.0 - PRICE, True, 2)


def test_a_rate_that_does_not_see_the_end_of_a_response_needs_coarser_ones_that_do(
    seen: tuple[Look, ...],
) -> None:
    looks_of = changed(seen, (90.0, 1.0, 2.0), (40.0, 1.0, 2.0), (30.0, 1.0, 2.0))
    first, second, third = looks_of
    (silent,) = changed(seen[2:], (0.5 * PRICE, 1.0, 2.0))
    assert agreement((first, second), 0).alike
    assert agreement((ending(first, 0.99 * UNDIED), second), 0).alike
    beyond = ending(first, 1.01 * UNDIED), ending(second, -1.01 * UNDIED)
    assert agreement((*beyond, third), 0).alike
    assert not agreement((*beyond, silent), 0).alike
    assert not agreement((*beyond, ending(third, 1.0)), 0).alike
    assert not agreement((ending(first, 1.0),), 0).alike


@pytest.mark.trial
def test_a_slow_process_without_friction_is_not_called_sticky() -> None:
    """Its response of 100 samples outlasts the taps of three rates."""
    answer = identify(slow_loop())
    assert not answer.valves[0].verdict.has_friction


def test_one_rate_alone_shows_nothing(seen: tuple[Look, ...]) -> None:
    found = agreement(changed(seen, (300.0, 1.0, 2.0), (1.0, 1.0, 2.0), (0.5, 1.0, 2.0)), 0)
    assert found.gain == 1.0 - PRICE


def test_beside_a_wave_friction_must_gain_more(seen: tuple[Look, ...]) -> None:
    (look,) = changed(seen, (300.0, 1.0, 2.0))
    waved = dataclasses.replace(look, wave_gain=200.0)
    assert look.beyond_price(0) == 300.0 - PRICE
    assert waved.beyond_price(0) == 300.0 - PRICE - BESIDE - 200.0 * INEXACT


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
    assert found.gain == short[0].accepted[0].gain - PRICE


@pytest.mark.trial
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


@pytest.mark.parametrize("every", [1, 2, 5])
def test_reports_are_counted_whether_held_or_drawn(every: int) -> None:
    record = pi_loop(3.0, 1.0, samples=1000, noise=0.1)
    rows = np.arange(1000)
    held = record.pv[rows - rows % every]
    drawn = np.interp(rows, rows[::every], record.pv[::every, 0])[:, None]
    for pv, bends in ((drawn, 1.0), (held, 2.0 if every > 1 else 1.0)):
        between = samples_between_reports(dataclasses.replace(record, pv=pv))
        assert between * bends == pytest.approx(every, rel=0.1)
