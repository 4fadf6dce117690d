import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction, KanoStiction, SemiPhysicalStiction
from stiction_ros.identification import ValveEstimate, VerdictKind
from stiction_ros.online.estimator.trust import TrustedFriction, TrustRule, ValveTrust, alike

STICKY, HEALTHY, UNDECIDED = VerdictKind.STICKY, VerdictKind.HEALTHY, VerdictKind.UNDECIDED
BACKLASH = VerdictKind.BACKLASH
EXACT = TrustRule(confirmations=2, tolerance=0.0, contradictions=2)


def window(
    verdict: VerdictKind,
    static: tuple[float, float] = (4.5, 5.5),
    dynamic: tuple[float, float] = (1.8, 2.2),
    name: str = "V1",
) -> ValveEstimate:
    f_s, f_d = sum(static) / 2.0, sum(dynamic) / 2.0
    return ValveEstimate(
        name, verdict, "he", f_s, static, f_d, dynamic, max(f_s - f_d, 0.0), 0.0, 40, {}
    )


def trust_after(*windows: ValveEstimate, rule: TrustRule = EXACT) -> TrustedFriction | None:
    trust = ValveTrust(rule)
    for estimate in windows:
        trust.update(estimate)
    return trust.trusted


TWO = (window(STICKY), window(STICKY))


def test_friction_is_trusted_by_one_law() -> None:
    kano = dataclasses.replace(window(STICKY), law="kano")
    assert trust_after(window(STICKY), kano) is None
    trusted = trust_after(*TWO, kano, kano)
    assert trusted is not None
    assert trusted.behaviour() == KanoStiction(7.0, 3.0)
    assert not alike({"V1": trusted}, {"V1": dataclasses.replace(trusted, law="xch")})
    slips = dataclasses.replace(window(STICKY), law="semi_physical", further={"k": 1.8})
    trusted = trust_after(slips, slips)
    assert trusted is not None
    assert trusted.behaviour() == SemiPhysicalStiction(5.0, 2.0, 1.8)


def test_one_sticky_window_is_not_trusted() -> None:
    assert trust_after(window(STICKY)) is None


def test_two_agreeing_sticky_windows_are_trusted_with_their_intersection() -> None:
    trusted = trust_after(window(STICKY, (4.0, 5.2), (1.5, 2.1)), window(STICKY, (4.8, 6.0)))
    assert trusted is not None
    assert (trusted.static_interval, trusted.dynamic_interval) == ((4.8, 5.2), (1.8, 2.1))
    assert 4.8 <= trusted.static_friction <= 5.2
    assert 1.8 <= trusted.dynamic_friction <= 2.1


@pytest.mark.parametrize("pair", [(BACKLASH, BACKLASH), (STICKY, BACKLASH), (BACKLASH, STICKY)])
def test_backlash_is_trusted_as_any_friction(pair: tuple[VerdictKind, VerdictKind]) -> None:
    trusted = trust_after(*(window(kind) for kind in pair))
    assert trusted == trust_after(*TWO)


@pytest.mark.parametrize("pair", [(BACKLASH, BACKLASH), (STICKY, BACKLASH), (BACKLASH, STICKY)])
def test_disjoint_windows_with_backlash_replace_the_trust(
    pair: tuple[VerdictKind, VerdictKind],
) -> None:
    trusted = trust_after(*TWO, *(window(kind, (8.0, 9.0)) for kind in pair))
    assert trusted is not None
    assert trusted.static_interval == (8.0, 9.0)


@pytest.mark.parametrize("between", [HEALTHY, UNDECIDED])
def test_sticky_windows_must_follow_each_other(between: VerdictKind) -> None:
    assert trust_after(window(STICKY), window(between), window(STICKY)) is None


def test_sticky_windows_that_disagree_start_anew() -> None:
    far, near = window(STICKY, (8.0, 9.0)), window(STICKY, (8.5, 9.5))
    assert trust_after(window(STICKY), far) is None
    trusted = trust_after(window(STICKY), far, near)
    assert trusted is not None
    assert trusted.static_interval == (8.5, 9.0)


def test_windows_that_agree_on_one_friction_only_are_not_trusted() -> None:
    assert trust_after(window(STICKY), window(STICKY, dynamic=(3.0, 4.0))) is None


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_as_many_windows_as_asked_are_needed(count: int) -> None:
    rule = TrustRule(confirmations=count, tolerance=0.0)
    assert trust_after(*[window(STICKY)] * (count - 1), rule=rule) is None
    assert trust_after(*[window(STICKY)] * count, rule=rule) is not None


@pytest.mark.parametrize("verdict", list(VerdictKind))
def test_a_wide_window_changes_nothing_whatever_it_says(verdict: VerdictKind) -> None:
    before = trust_after(*TWO)
    assert trust_after(*TWO, *[window(verdict, (0.0, 6.5), (0.0, 6.5))] * 5) == before


def test_a_narrower_window_narrows_the_trust() -> None:
    trusted = trust_after(*TWO, window(STICKY, (4.9, 5.1), (1.95, 2.05)))
    assert trusted is not None
    assert (trusted.static_interval, trusted.dynamic_interval) == ((4.9, 5.1), (1.95, 2.05))


def test_one_disjoint_window_changes_nothing() -> None:
    assert trust_after(*TWO, window(STICKY, (8.0, 9.0))) == trust_after(*TWO)


def test_two_disjoint_sticky_windows_replace_the_trust() -> None:
    trusted = trust_after(*TWO, *[window(STICKY, (8.0, 9.0))] * 2)
    assert trusted is not None
    assert trusted.static_interval == (8.0, 9.0)


def test_disjoint_windows_must_follow_each_other() -> None:
    far = window(STICKY, (8.0, 9.0))
    assert trust_after(*TWO, far, window(STICKY), far) == trust_after(*TWO)


@pytest.mark.parametrize("other", [HEALTHY, UNDECIDED])
def test_disjoint_windows_of_different_verdicts_change_nothing(other: VerdictKind) -> None:
    before = trust_after(*TWO)
    sticky, odd = window(STICKY, (8.0, 9.0)), window(other, (0.0, 0.2), (0.0, 0.2))
    assert trust_after(*TWO, odd, sticky) == before
    assert trust_after(*TWO, sticky, odd) == before


def test_two_disjoint_healthy_windows_end_the_trust() -> None:
    band = window(HEALTHY, (0.0, 0.2), (0.0, 0.2))
    assert trust_after(*TWO, band) is not None
    assert trust_after(*TWO, band, band) is None


def test_an_undecided_window_never_replaces_or_ends_the_trust() -> None:
    before = trust_after(*TWO)
    assert trust_after(*TWO, *[window(UNDECIDED, (8.0, 9.0))] * 5) == before


def test_after_the_end_of_trust_it_must_be_earned_again() -> None:
    band = window(HEALTHY, (0.0, 0.2), (0.0, 0.2))
    assert trust_after(*TWO, band, band, window(STICKY)) is None
    assert trust_after(*TWO, band, band, *TWO) is not None


def test_the_tolerance_lets_near_windows_agree() -> None:
    near = (window(STICKY, (4.5, 4.98)), window(STICKY, (5.02, 5.5)))
    assert trust_after(*near) is None
    trusted = trust_after(*near, rule=TrustRule(tolerance=0.02))
    assert trusted is not None


intervals = st.tuples(st.floats(0.0, 10.0), st.floats(0.0, 3.0)).map(lambda p: (p[0], p[0] + p[1]))
windows = st.builds(window, st.sampled_from(list(VerdictKind)), intervals, intervals)


@given(st.lists(windows, max_size=12), st.floats(0.0, 0.1))
def test_whatever_comes_the_trust_is_a_friction_within_its_intervals(
    seen: list[ValveEstimate], tolerance: float
) -> None:
    trust = ValveTrust(TrustRule(tolerance=tolerance))
    for estimate in seen:
        trusted = trust.update(estimate)
        if trusted is not None:
            low, high = trusted.static_interval
            assert low <= trusted.static_friction <= high
            low, high = trusted.dynamic_interval
            assert low <= trusted.dynamic_friction <= high
            assert isinstance(trusted.behaviour(), HeStiction)


@given(st.lists(st.builds(window, st.sampled_from([HEALTHY, UNDECIDED]), intervals, intervals)))
def test_without_a_sticky_window_nothing_is_ever_trusted(seen: list[ValveEstimate]) -> None:
    assert trust_after(*seen) is None


def test_a_firm_trust_is_narrowed_but_never_replaced() -> None:
    trust = ValveTrust(EXACT)
    for _ in range(2):
        trust.update(window(STICKY))
    for _ in range(4):
        trust.update(window(HEALTHY, (0.0, 0.2), (0.0, 0.2)), firm=True)
        trust.update(window(STICKY, (8.0, 9.0)), firm=True)
    assert trust.trusted is not None
    assert trust.trusted.static_interval == (4.5, 5.5)
    trust.update(window(STICKY, (4.9, 5.1)), firm=True)
    assert trust.trusted.static_interval == (4.9, 5.1)


@pytest.mark.parametrize("new", [None, TrustedFriction(7.0, (6.9, 9.0), 2.0, (1.9, 2.1))])
def test_what_a_change_has_left_is_trusted_at_once(new: TrustedFriction | None) -> None:
    trust = ValveTrust(EXACT)
    for _ in range(2):
        trust.update(window(STICKY))
    trust.renew(new)
    assert trust.trusted == new
    trust.update(window(STICKY))  # one window does not bring the old one back
    assert trust.trusted == new


def test_a_friction_that_is_not_settled_is_offered_just_above_what_failed() -> None:
    old = TrustedFriction(5.0, (4.9, 5.1), 2.0, (1.9, 2.1))
    wide = old.narrowed((7.1, 9.3), 2.05, (1.95, 2.15), anew=True)
    assert not wide.settled
    assert wide.static_friction == pytest.approx(1.01 * 7.1)
    assert wide.offered_interval == (7.1, pytest.approx(1.06 * 7.1))
    assert (wide.dynamic_friction, wide.dynamic_interval) == (2.0, (1.9, 2.1))
    near = wide.narrowed((6.0, 7.8), 3.0, (2.9, 3.1), anew=False)
    assert near.settled
    assert near.static_interval == near.offered_interval == (7.1, 7.8)
    assert near.static_friction == pytest.approx(7.45)
    assert (near.dynamic_friction, near.dynamic_interval) == (3.0, (2.9, 3.1))


@given(intervals, intervals, st.booleans())
def test_whatever_moves_tell_the_offered_friction_lies_in_its_interval(
    static: tuple[float, float], dynamic: tuple[float, float], anew: bool
) -> None:
    old = TrustedFriction(5.0, (4.9, 5.1), 2.0, (1.9, 2.1))
    new = old.narrowed(static, sum(dynamic) / 2.0, dynamic, anew=anew)
    low, high = new.static_interval
    assert low <= new.static_friction <= max(high, 1.01 * low)
    assert new.dynamic_interval[0] <= new.dynamic_friction <= new.dynamic_interval[1]
    assert new.offered_interval[0] == low
    assert new.offered_interval[1] <= high


def test_only_what_a_controller_would_notice_is_a_difference() -> None:
    old = TrustedFriction(5.0, (4.9, 5.1), 2.0, (1.9, 2.1))
    near = TrustedFriction(5.03, (4.95, 5.1), 2.01, (1.9, 2.1))
    far = TrustedFriction(5.2, (5.1, 5.3), 2.0, (1.9, 2.1))
    assert alike({"V1": old}, {"V1": near})
    assert not alike({"V1": old}, {"V1": far})
    assert not alike({"V1": old}, {})
    assert alike({}, {})


@pytest.mark.parametrize("high", [4.0, 12.0])
def test_moves_that_tell_no_lower_end_leave_the_friction_in_force(high: float) -> None:
    known = TrustedFriction(8.0, (7.8, 8.2), 1.0, (0.9, 1.1))
    found = known.narrowed((0.0, high), 1.0, (0.9, 1.1), anew=True)
    assert not found.settled
    assert found.static_friction == min(8.0, high)
