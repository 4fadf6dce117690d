import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.control.belief import jump_form
from stiction_ros.effects import (
    ChoudhuryStiction,
    FrictionPair,
    HeStiction,
    KanoStiction,
    Stiction,
    XchStiction,
)
from stiction_ros.identification import OutputModel
from stiction_ros.identification.friction import behaviour_of
from stiction_ros.online.estimator.change_evidence import Evidence, OutputReference, Reference
from stiction_ros.online.estimator.friction_change import (
    ChangeRule,
    ChangeStatus,
    FrictionChange,
    look_for_change,
    narrowed,
)
from stiction_ros.online.estimator.trust import TrustedFriction

SAMPLES, CHANGE = 900, 400
NOISE = 0.01
OLD = HeStiction(5.0, 2.0)
TRUSTED = TrustedFriction(5.0, (4.9, 5.1), 2.0, (1.9, 2.1))
MODEL = OutputModel("PV1", (-0.9,), {"V1": (0.1,)}, {"V1": 1}, 0.0, NOISE, 99.0, 99.0)
REFERENCE = Reference(("V1",), (OutputReference(MODEL, np.zeros(0), NOISE),))


def kicks(
    least: float, most: float, seed: int = 0, small: float | None = None, old: Stiction = OLD
) -> np.ndarray:
    """OP that moves a stem by kicks every 15 samples, as its controller takes it to be.

    OP leads the believed stem by ``least`` to ``most`` % for one sample, and rests there after;
    three times after the change only by ``small`` % where that is given.
    """
    random, form = np.random.default_rng(seed), jump_form(old)
    op, stem = np.full(SAMPLES, 50.0), 50.0
    for k in range(0, SAMPLES, 15):
        size = random.uniform(least, most)
        if small is not None and CHANGE <= k < CHANGE + 45:
            size = small
        lead = size * (1.0 if stem < 50.0 else -1.0)
        way = form.way(stem, stem, stem + lead)
        op[k : k + len(way)] = way
        stem = way[-1] - np.sign(lead) * form.dynamic_friction
        op[k + len(way) : k + 15] = stem
    return op


def evidence(
    op: np.ndarray,
    new: Stiction | None,
    *,
    seed: int = 1,
    gain: float = 1.0,
    load: float = 0.0,
    old: Stiction = OLD,
) -> Evidence:
    """A record whose valve changes at :data:`CHANGE`; None for one without friction."""
    stem = old.simulate(op, 50.0)
    start = float(stem[CHANGE - 1])
    stem[CHANGE:] = op[CHANGE:] if new is None else new.simulate(op[CHANGE:], start)
    pv = np.zeros(SAMPLES)
    for k in range(2, SAMPLES):
        pv[k] = 0.9 * pv[k - 1] + gain * 0.1 * (stem[k - 2] - 50.0)
    pv[CHANGE:] += load
    pv += NOISE * np.random.default_rng(seed).standard_normal(SAMPLES)
    trusted = old.simulate(op, 50.0)
    return Evidence(REFERENCE, op[:, None], trusted[:, None], pv[:, None], {0: old})


RULE = ChangeRule()


def look(seen: Evidence, rule: ChangeRule = RULE) -> FrictionChange:
    return look_for_change(rule, seen, 0, TRUSTED)


@pytest.mark.parametrize("seed", range(6))
def test_a_valve_that_is_as_it_was_is_not_changed(seed: int) -> None:
    found = look(evidence(kicks(5.5, 9.0, seed), OLD, seed=seed))
    assert found.status is ChangeStatus.UNCHANGED
    assert not found.doubted
    assert found.explained


@pytest.mark.parametrize("gain", [0.8, 1.25])
def test_a_process_of_another_gain_is_no_change_of_the_valve(gain: float) -> None:
    assert look(evidence(kicks(5.5, 9.0), OLD, gain=gain)).status is ChangeStatus.UNCHANGED


@pytest.mark.parametrize("load", [-0.5, 0.1, 2.0])
def test_a_load_is_no_change_of_the_valve(load: float) -> None:
    assert look(evidence(kicks(5.5, 9.0), OLD, load=load)).status is ChangeStatus.UNCHANGED


@pytest.mark.parametrize("new", [None, HeStiction(0.2, 0.1), HeStiction(0.3, 0.3)])
@pytest.mark.parametrize("gain", [1.0, 1.15])
def test_a_serviced_valve_shows_in_its_kicks(new: HeStiction | None, gain: float) -> None:
    found = look(evidence(kicks(5.5, 9.0), new, gain=gain))
    assert found.status is ChangeStatus.SERVICED
    assert found.friction is None
    assert found.samples == pytest.approx(SAMPLES - CHANGE, abs=16)


def test_a_few_moves_are_not_enough() -> None:
    rule = ChangeRule(change_moves=60)
    found = look(evidence(kicks(5.5, 9.0), None), rule)
    assert found.status is ChangeStatus.UNCHANGED


@pytest.mark.parametrize(
    ("new", "op", "widest"),
    [
        (HeStiction(7.5, 2.0), kicks(5.5, 9.0), 1.2),
        (HeStiction(7.5, 2.0), kicks(9.0, 9.5, small=6.0), 2.0),
        (HeStiction(7.5, 3.0), kicks(9.0, 9.5, small=6.0), 2.0),
    ],
)
def test_a_valve_that_stays_where_it_should_have_moved_sticks_more(
    new: HeStiction, op: np.ndarray, widest: float
) -> None:
    found = look(evidence(op, new))
    assert found.status is ChangeStatus.CHANGED
    assert found.friction is not None
    low, high = found.friction.static_interval
    assert low <= 7.5 <= high
    assert high <= widest * low
    assert found.friction.dynamic_friction == pytest.approx(new.dynamic_friction, abs=0.25)


@pytest.mark.parametrize("kind", [KanoStiction, ChoudhuryStiction, XchStiction])
def test_a_change_is_seen_by_the_law_that_is_trusted(kind: type[FrictionPair]) -> None:
    old = behaviour_of(str(kind.law), (5.0, 2.0), {})
    trusted = dataclasses.replace(TRUSTED, law=kind.law)
    op = kicks(5.5, 9.0, old=old)
    new = (old, None, old.with_frictions(7.5, 2.0))
    found = [look_for_change(RULE, evidence(op, one, old=old), 0, trusted) for one in new]
    assert [one.status for one in found] == list(ChangeStatus)
    assert found[2].friction is not None
    grown = found[2].friction.behaviour()
    assert isinstance(grown, kind)
    assert grown.static_friction == pytest.approx(7.5, abs=0.4)
    assert grown.dynamic_friction == pytest.approx(2.0, abs=0.25)


def test_the_same_stems_are_as_likely_from_wherever_they_are_said_to_begin() -> None:
    """Held against the same samples, that is; a gain left open fits fewer of them better."""
    seen = evidence(kicks(5.5, 9.0), HeStiction(7.5, 2.0))
    stems = seen.stem[:, :1].copy()
    stems[CHANGE:, 0] = HeStiction(7.5, 2.0).simulate(seen.op[CHANGE:, 0], stems[CHANGE - 1, 0])
    early, late = CHANGE - 90, CHANGE - 15
    alike = [seen.gains(0, first, stems[first:], early) for first in (early, late)]
    assert alike[0][0] == pytest.approx(alike[1][0])
    assert alike[0][1] == pytest.approx(alike[1][1])
    assert seen.gains(0, late, stems[late:])[0] != pytest.approx(alike[0][0], abs=0.1)


def test_growth_that_no_move_meets_is_not_seen() -> None:
    assert look(evidence(kicks(8.0, 9.0), HeStiction(7.5, 2.0))).status is ChangeStatus.UNCHANGED


def test_a_wide_interval_is_offered_from_below_and_narrowed_by_what_follows() -> None:
    """First moves below 6 and above 9, then some in between."""
    op = kicks(5.5, 9.0)
    wide = TrustedFriction(5.6, (5.5, 9.0), 2.0, (1.9, 2.1), settled=False)
    assert wide.offered_interval == (5.5, pytest.approx(1.06 * 5.5))
    new = HeStiction(7.5, 2.0)
    seen = evidence(op, new)
    stem = seen.stem.copy()
    stem[CHANGE:, 0] = HeStiction(5.6, 2.0).simulate(op[CHANGE:], stem[CHANGE - 1, 0])
    seen = Evidence(REFERENCE, seen.op, stem, seen.pv, {0: OLD}, CHANGE)
    found = narrowed(seen, 0, wide, whole=True)
    assert found.settled
    assert found.static_interval[0] <= 7.5 <= found.static_interval[1]
    assert found.static_friction == pytest.approx(7.5, abs=0.4)
    assert found.offered_interval == found.static_interval


@given(st.floats(-2.0, 2.0), st.floats(-0.3, 0.3), st.integers(0, 5))
def test_a_share_is_what_was_put_in_whatever_the_gain(share: float, gain: float, seed: int) -> None:
    seen = evidence(kicks(5.5, 9.0, seed), OLD)
    signature = seen.signature(0, 0, seen.op)
    centred = seen.stem[:, 0] - seen.stem[:, 0].mean()
    output = REFERENCE.outputs[0]
    seen.innovations = [share * signature[0][:, 0] + gain * output.response("V1", centred)]
    assert seen.share(0, 0, seen.op[:, 0]).value == pytest.approx(share, abs=1e-6)


def test_two_valves_are_told_apart() -> None:
    model = dataclasses.replace(MODEL, b={"V1": (0.1,), "V2": (0.05,)}, delay={"V1": 1, "V2": 0})
    both = Reference(("V1", "V2"), (OutputReference(model, np.zeros(0), NOISE),))
    first = evidence(kicks(5.5, 9.0), None)
    other = kicks(5.5, 9.0, 5)
    second = OLD.simulate(other, 50.0)
    pv = first.pv[:, 0].copy()
    state = 0.0
    for k in range(1, SAMPLES):
        state = 0.9 * state + 0.05 * (second[k - 1] - 50.0)
        pv[k] += state
    seen = Evidence(
        both,
        np.column_stack([first.op[:, 0], other]),
        np.column_stack([first.stem[:, 0], second]),
        pv[:, None],
        {0: OLD, 1: OLD},
    )
    found = [look_for_change(ChangeRule(), seen, j, TRUSTED).status for j in range(2)]
    assert found == [ChangeStatus.SERVICED, ChangeStatus.UNCHANGED]
