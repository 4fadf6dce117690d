import dataclasses

from hypothesis import given
from hypothesis import strategies as st
from made import entry

from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.ranking import ranked

SHARES = st.floats(0.0, 1.0)


@st.composite
def entries(draw: st.DrawFn) -> list[Entry]:
    count = draw(st.integers(1, 12))
    return [
        entry(
            f"L{k}",
            draw(st.sampled_from(["sticky", "backlash", "undecided", "healthy"])),
            draw(st.sampled_from(["valve", "tuning", "disturbance", "none"])),
            probability=draw(SHARES),
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
def test_the_likelier_and_what_a_service_brings_more_stands_higher(
    share: float, more: float
) -> None:
    one, other = entry("A", probability=share), entry("B", probability=share + more)
    assert [row.name for row in ranked([one, other], {})] == ["B", "A"]
    one, other = (
        entry(name, evidence={"loop_gone": gone})
        for name, gone in (("A", share), ("B", share + more))
    )
    assert [row.name for row in ranked([one, other], {})] == ["B", "A"]


def test_money_counts_where_it_is_known() -> None:
    rows = [entry("A", probability=0.9), entry("B", probability=0.8), entry("C", probability=0.7)]
    order = ranked(rows, {"C": 100.0, "B": 1.0})
    assert order[0].name == "C"
    costs = {row.name: row.cost_per_hour for row in order}
    assert costs["A"] is None
    assert costs["C"] == 100.0 * costs["B"]


def test_what_was_not_judged_stands_last() -> None:
    lost = dataclasses.replace(entry("A"), status=Status.FAILED)
    assert [row.name for row in ranked([lost, entry("B", "healthy", "none")], {})] == ["B", "A"]


def test_an_undecided_valve_stands_between_found_and_healthy_ones() -> None:
    rows = [
        entry("H", "healthy", "disturbance", probability=0.9),
        entry("U", "undecided", "none", probability=0.01),
        entry("V", "undecided", "valve", probability=0.2),
        entry("S", "sticky", "none", probability=0.05),
    ]
    assert [row.name for row in ranked(rows, {})] == ["S", "V", "U", "H"]
