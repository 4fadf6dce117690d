from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import entry

from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.ranking import NOT_HELD, confidence, ranked

SHARES = st.floats(0.0, 1.0)


@st.composite
def entries(draw: st.DrawFn) -> list[Entry]:
    count = draw(st.integers(1, 12))
    return [
        entry(
            f"L{k}",
            draw(st.sampled_from(["sticky", "backlash", "undecided", "healthy"])),
            draw(st.sampled_from(["valve", "tuning", "disturbance", "none"])),
            confidence=draw(SHARES),
            band_share=draw(SHARES),
        )
        for k in range(count)
    ]


@given(entries(), st.randoms())
def test_the_order_in_which_loops_come_does_not_matter(rows: list[Entry], random: object) -> None:
    mixed = list(rows)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    assert ranked(rows, {}) == ranked(mixed, {})
    assert [row.rank for row in ranked(rows, {})] == list(range(1, len(rows) + 1))


@given(entries())
def test_what_is_found_stands_above_what_is_not(rows: list[Entry]) -> None:
    found = [row.found for row in ranked(rows, {})]
    assert found == sorted(found, reverse=True)


@given(st.floats(0.01, 0.98), st.floats(0.001, 0.01))
def test_more_confidence_or_a_wider_band_stands_higher(share: float, more: float) -> None:
    one, other = entry("A", confidence=share), entry("B", confidence=share + more)
    assert [row.name for row in ranked([one, other], {})] == ["B", "A"]
    one, other = entry("A", band_share=share), entry("B", band_share=share + more)
    assert [row.name for row in ranked([one, other], {})] == ["B", "A"]


def test_money_counts_where_it_is_known() -> None:
    rows = [entry("A", confidence=0.9), entry("B", confidence=0.8), entry("C", confidence=0.7)]
    order = ranked(rows, {"C": 100.0, "B": 1.0})
    assert order[0].name == "C"
    costs = {row.name: row.cost_per_hour for row in order}
    assert costs["A"] is None
    assert costs["C"] == 100.0 * costs["B"]


def test_what_was_not_judged_stands_last() -> None:
    lost = dataclasses.replace(entry("A"), status=Status.FAILED)
    assert [row.name for row in ranked([lost, entry("B", "healthy", "none")], {})] == ["B", "A"]


def test_confidence_falls_with_what_is_not_known() -> None:
    sure = {"verdict": "sticky", "f_s_interval": [1.9, 2.1]}
    assert confidence(sure, "valve", 3) == pytest.approx(
        0.5 * confidence(sure, "valve", 10**6), rel=1e-5
    )
    assert 0.9 < confidence(sure, "valve", 10**6) <= 1.0
    wide = {**sure, "f_s_interval": [0.0, 4.0]}
    assert confidence(wide, "valve", 10**6) == pytest.approx(0.5, rel=1e-5)
    assert (
        confidence(sure, "disturbance", 10**6)
        < confidence(sure, "none", 10**6)
        < confidence(sure, "valve", 10**6)
    )
    barely, well, surely = (
        confidence({**sure, "evidence": {"delta_bic": beyond}}, "valve", 10**6)
        for beyond in (0.0, 50.0, 1e6)
    )
    assert barely == pytest.approx(0.3 * surely, rel=1e-4)
    assert barely < well < surely < confidence(sure, "valve", 10**6)
    half = {"tried": [{}, {}], "agreed": ["first half"]}
    assert confidence({**sure, "stability": half}, "valve", 10**6) == 0.5 * confidence(
        sure, "valve", 10**6
    )
    held, loose = (
        confidence({**sure, "evidence": {"held": one}}, "valve", 10**6) for one in (1.0, 0.0)
    )
    assert loose == pytest.approx(NOT_HELD * held)
    shown = {"gain_1": 1e6}
    open_verdict = {**sure, "verdict": "undecided", "evidence": shown}
    assert confidence(open_verdict, "valve", 10**6) < confidence(wide, "valve", 10**6)


def test_an_undecided_valve_stands_higher_where_the_closed_loop_speaks_for_it() -> None:
    def believed(cause: str, **told: float) -> float:
        evidence = {"gain_1": 40.0, **told}
        return confidence({"verdict": "undecided", "evidence": evidence}, cause, 0)

    assert believed("disturbance") < believed("none") < believed("valve")
    assert believed("none") < believed("none", loop_gone=0.5, moved_with=1.0)
    assert believed("none") == believed("none", loop_gone=0.5, moved_with=20.0)


@given(
    st.dictionaries(
        st.sampled_from([1, 2, 4, 8]), st.floats(-1e3, 1e6, allow_subnormal=False), min_size=1
    )
)
def test_undecided_valves_stand_by_what_their_friction_gains_where_it_gains_most(
    gains: dict[int, float],
) -> None:
    def believed(gains: dict[int, float]) -> float:
        told = {f"gain_{rate}": gain for rate, gain in gains.items()}
        return confidence({"verdict": "undecided", "evidence": told}, None, 0)

    most = max(gains.values())
    assert believed(gains) == believed({1: most})
    assert 0.0 <= believed(gains) <= 0.3
    assert (believed(gains) > 0.0) == (most > 0.0)
    assert believed(gains) < believed({1: max(most, 0.0) + 10.0 + abs(most)})


def test_an_undecided_valve_stands_between_found_and_healthy_ones() -> None:
    rows = [
        entry("H", "healthy", "disturbance", confidence=0.9),
        entry("U", "undecided", "none", confidence=0.01),
        entry("V", "undecided", "valve", confidence=0.2),
        entry("S", "sticky", "none", confidence=0.05),
    ]
    assert [row.name for row in ranked(rows, {})] == ["S", "V", "U", "H"]
