"""The rules of the input port: what arrives when, what comes out, what is counted.

A sample is written as a word: its stamp in seconds, after ``^`` when a run begins with it, then
``+`` when it is answered and ``-`` when it is passed over, then ``?`` when its PV is NaN.
"""

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stiction_ros.loop import Instrument
from stiction_ros.online.input.port import PATIENCE, InputPort
from stiction_ros.online.input.sample_grid import SUCCESSION
from stiction_ros.online.input.samples import PortRules, Sample, SetPointPreview

S = 10**9
NAN = float("nan")
RULES = PortRules(S, (Instrument(0.0, 100.0, 10.0),))
LOCKSTEP = {
    "scheduled": RULES,
    "external": dataclasses.replace(RULES, scheduled=False),
    "dv": dataclasses.replace(RULES, scheduled=False, needs_dv=True),
}
REALTIME = dataclasses.replace(RULES, lockstep=False, period=1.0)


def word(sample: Sample) -> str:
    stamp = f"{sample.stamp / S:g}"
    unknown = "?" if np.isnan(sample.pv).any() else ""
    return ("^" if sample.begins else "") + stamp + "-+"[sample.answered] + unknown


class Feed:
    """A port that is fed with events such as ``("pv", 3.0)``, a second a second."""

    def __init__(self, rules: PortRules) -> None:
        self.port = InputPort(rules)
        self.samples: list[Sample] = []

    def event(self, now: float, kind: str, stamp: float, value: Any = 50.0) -> None:
        values = None if value is None else np.atleast_1d(np.asarray(value, dtype=float))
        if kind == "tick":
            self.out(self.port.overdue(now), now)
            return
        if kind == "rest":
            self.port.rest()
            return
        add = {
            "pv": self.port.add_pv,
            "queued": self.port.add_pv,
            "sp": self.port.add_sp,
            "dv": self.port.add_dv,
            "applied": self.port.add_applied,
        }[kind]
        add(now, round(stamp * S), values)
        if kind != "queued":
            self.take(now)

    def take(self, now: float) -> None:
        while self.port.ready() and (samples := self.port.take(now)):
            self.out(samples, now)

    def out(self, samples: tuple[Sample, ...], now: float) -> None:
        self.samples += samples
        if samples:
            self.port.sent(now)

    def good(self, now: float, stamp: float, pv: float = 50.0) -> None:
        """One sample with everything that belongs to it."""
        self.event(now, "applied", stamp - 1.0)
        self.event(now, "sp", stamp)
        self.event(now, "dv", stamp)
        self.event(now, "pv", stamp, pv)

    @property
    def words(self) -> str:
        return " ".join(word(sample) for sample in self.samples)

    def counted(self) -> dict[str, int]:
        return {name: count for name, count in self.port.counts.items() if count}


# ---- lockstep ----------------------------------------------------------------------------------

# rules, events (kind, stamp, value), samples, counts
LOCKSTEP_TABLE: dict[str, tuple[str, list[tuple[Any, ...]], str, dict[str, int]]] = {
    "in order": ("scheduled", [("sp", 1), ("pv", 1), ("sp", 2), ("pv", 2)], "^1+ 2+", {}),
    "pv before sp": ("scheduled", [("pv", 1), ("sp", 1), ("pv", 2), ("sp", 2)], "^1+ 2+", {}),
    "sp of another stamp": ("scheduled", [("sp", 1), ("pv", 2)], "", {}),
    "oldest first": ("scheduled", [("pv", 2), ("pv", 1), ("sp", 1), ("sp", 2)], "^1+ 2+", {}),
    "the last sp holds": ("external", [("sp", 0), ("pv", 1), ("pv", 2)], "^1+ 2+", {}),
    "dv is waited for": (
        "dv",
        [("sp", 0), ("pv", 1), ("dv", 1), ("dv", 2), ("pv", 2)],
        "^1+ 2+",
        {},
    ),
    "shown again": (
        "scheduled",
        [("sp", 1), ("pv", 1), ("sp", 2), ("sp", 2), ("pv", 2)],
        "^1+ 2+",
        {},
    ),
    "shown again before its sp": (
        "scheduled",
        [("pv", 1), ("pv", 1), ("sp", 1), ("pv", 2), ("sp", 2)],
        "^1+ 2+",
        {},
    ),
    "a stale one": (
        "external",
        [("sp", 0), ("pv", 5), ("pv", 3), ("pv", 6)],
        "^5+ 6+",
        {"stale": 1},
    ),
    "a stale one that has no sp": (
        "scheduled",
        [("pv", 0), ("sp", 5), ("pv", 5), ("sp", 6), ("pv", 6)],
        "^5+ 6+",
        {},
    ),
    "far ahead": (
        "external",
        [("sp", 0), ("pv", 5), ("pv", 4000), ("pv", 6)],
        "^5+ 6+",
        {"ahead": 1},
    ),
    "a far one in the queue": (
        "scheduled",
        [("sp", 5), ("pv", 5), ("queued", 4000), ("sp", 6), ("pv", 6)],
        "^5+ 6+",
        {"ahead": 1},
    ),
    "one that is lost": (
        "scheduled",
        [("sp", 1), ("pv", 1), ("sp", 3), ("pv", 3)],
        "^1+ 2-? 3+",
        {"missing": 1},
    ),
    "wrong tags": ("external", [("sp", 0), ("pv", 1, None), ("pv", 2)], "^2+", {"wrong tags": 1}),
    "empty positions": ("external", [("sp", 0), ("pv", 1, NAN)], "^1+?", {"bad values": 1}),
    "out of range": (
        "external",
        [("sp", 0), ("pv", 1), ("pv", 2, 1e6), ("pv", 3)],
        "^1+ 2+? 3+",
        {"out of range": 1},
    ),
    "too fast": (
        "external",
        [("sp", 0), ("pv", 1), ("pv", 2, 70.0), ("pv", 3, 70.0), ("pv", 4, 70.0)],
        "^1+ 2+? 3+? 4+",
        {"out of range": 2},
    ),
    "sp out of range": (
        "scheduled",
        [("sp", 1), ("pv", 1), ("sp", 2, 1e9), ("pv", 2)],
        "^1+ 2+",
        {"refused sp": 1},
    ),
    "sp is no number": (
        "external",
        [("sp", 0, NAN), ("pv", 1), ("sp", 1), ("pv", 2)],
        "^1+ 2+",
        {"refused sp": 1},
    ),
    "dv is no number": ("dv", [("sp", 0), ("dv", 1, NAN), ("pv", 1)], "^1+", {"refused dv": 1}),
    "a plant begun anew that shows its sample again": (
        "scheduled",
        [("sp", 90), ("pv", 90), *[("sp", 1), ("pv", 1)] * SUCCESSION, ("sp", 2), ("pv", 2)],
        "^90+ ^1+ 2+",
        {"stale": SUCCESSION, "new runs": 1},
    ),
    "after a pause the plant goes on where it waited": (
        "scheduled",
        [("sp", 1), ("pv", 1), ("queued", 2), ("rest", 0), ("sp", 2), ("pv", 2)],
        "^1+ 2+",
        {},
    ),
}


@pytest.mark.parametrize("case", LOCKSTEP_TABLE)
def test_lockstep(case: str) -> None:
    rules, events, words, counts = LOCKSTEP_TABLE[case]
    feed = Feed(LOCKSTEP[rules])
    for kind, stamp, *value in events:
        feed.event(0.0, kind, stamp, *value)
    assert feed.words == words
    assert feed.counted() == counts


def test_in_lockstep_nothing_depends_on_the_clock() -> None:
    words = set()
    for pace in (0.0, 1e-6, 1e6):
        feed = Feed(RULES)
        for k in range(30):
            feed.event(k * pace, "sp", k)
            feed.event(k * pace, "pv", k)
            feed.event(k * pace, "tick", 0)
        words.add(feed.words)
    assert len(words) == 1


def test_in_lockstep_what_waits_while_a_fit_is_awaited_is_not_lost() -> None:
    feed = Feed(RULES)
    for k in range(300):
        feed.event(0.0, "sp", k) if k == 0 else feed.port.add_sp(0.0, k * S, np.array([50.0]))
        feed.event(0.0, "queued" if k else "pv", k)
    feed.take(0.0)
    assert [sample.stamp // S for sample in feed.samples] == list(range(300))
    assert all(sample.answered for sample in feed.samples)


def test_in_lockstep_an_sp_that_is_refused_leaves_the_last_in_force() -> None:
    feed = Feed(RULES)
    for stamp, sp in ((1, 40.0), (2, 1e9), (3, NAN)):
        feed.event(0.0, "sp", stamp, sp)
        feed.event(0.0, "pv", stamp)
    assert [float(sample.sp[0]) for sample in feed.samples] == [40.0] * 3


# ---- realtime ----------------------------------------------------------------------------------

START = [(0, "sp", 0), (0, "applied", 0), (1, "pv", 1), (2, "pv", 2)]
TEN = range(SUCCESSION)

# events (now, kind, stamp, value), samples, counts
REALTIME_TABLE: dict[str, tuple[list[tuple[Any, ...]], str, dict[str, int]]] = {
    "in order": ([(3, "pv", 3)], "3+", {}),
    "newest wins": (
        [(6, "queued", 3), (6, "queued", 4), (6, "queued", 5), (6, "pv", 6)],
        "3- 4- 5- 6+",
        {"passed over": 3},
    ),
    "swapped": ([(4, "queued", 4), (4, "pv", 3)], "3- 4+", {"passed over": 1}),
    "swapped and late": ([(4, "pv", 4), (4, "pv", 3)], "3-? 4+", {"missing": 1, "late": 1}),
    "one lost": ([(4, "pv", 4)], "3-? 4+", {"missing": 1}),
    "sp of another stamp": ([(3, "sp", 2.7), (3, "pv", 3)], "3+", {}),
    "beside the grid": ([(3, "pv", 3.3), (4, "pv", 4), (5, "pv", 4.7)], "3.3+ 4+ 4.7+", {}),
    "a stale one": ([(2.5, "pv", 1), (3, "pv", 3)], "3+", {"stale": 1}),
    "stamp 0": ([(2.5, "pv", 0), (3, "pv", 3)], "3+", {"stale": 1}),
    "the same again": ([(2.5, "pv", 2), (3, "pv", 3)], "3+", {"stale": 1}),
    "far ahead": ([(2.5, "pv", 2e9), (3, "pv", 3)], "3+", {"ahead": 1}),
    "stamps that no clock shows": (
        [(2.5, "pv", 4e9), (2.5, "pv", -1), (3, "pv", 3)],
        "3+",
        {"ahead": 1, "stale": 1},
    ),
    "ahead of what the clock allows": ([(2.5, "pv", 9), (3, "pv", 3)], "3+", {"ahead": 1}),
    "a gap as long as the clock says": (
        [(9, "pv", 9)],
        "3-? 4-? 5-? 6-? 7-? 8-? 9+",
        {"missing": 6},
    ),
    "a backlog that is longer than the clock says": (
        [(2.1, "queued", k) for k in range(3, 9)] + [(2.1, "queued", 99), (2.1, "pv", 9)],
        "3- 4- 5- 6- 7- 8- 9+",
        {"passed over": 6, "ahead": 1},
    ),
    "a stale one in the queue": (
        [(3, "queued", 1), (4, "queued", 3), (4, "pv", 4)],
        "3- 4+",
        {"stale": 1, "passed over": 1},
    ),
    "older stamps that rise": (
        [(3 + k / 10, "pv", k / 20) for k in TEN] + [(4, "pv", 1.45)],
        "^0.45+ 1.45+",
        {"stale": SUCCESSION, "new runs": 1},
    ),
    "older stamps with good ones between": (
        [event for k in TEN for event in ((3 + k, "pv", -90 + k), (3 + k, "pv", 3 + k))],
        " ".join(f"{3 + k}+" for k in TEN),
        {"stale": SUCCESSION},
    ),
    "a clock that was set": (
        [(3 + k / 10, "pv", 5000 + k) for k in TEN] + [(4, "pv", 5010)],
        "^5009+ 5010+",
        {"ahead": SUCCESSION, "new runs": 1},
    ),
    "a clock that was set, with a queue": (
        [(2.5, "queued", 5000 + k) for k in range(3 * SUCCESSION)] + [(2.5, "pv", 5030)],
        "^5030+",
        {"ahead": 3 * SUCCESSION + 1, "new runs": 1},
    ),
    "stamps far ahead at random": (
        [(3 + k / 10, "pv", 5000 * (1 + k)) for k in TEN] + [(4, "pv", 3)],
        "3+",
        {"ahead": SUCCESSION},
    ),
    "a gap that is too long for the observer": (
        [(400, "pv", 400), (401, "pv", 401)],
        "^400+ 401+",
        {"new runs": 1},
    ),
    "nothing comes": (
        [(3.9, "tick", 0), (4.1, "tick", 0), (4.2, "tick", 0), (5.1, "tick", 0)],
        "3+? 4+?",
        {"blind": 2},
    ),
    "nothing comes for long": ([(6.1, "tick", 0)], "3-? 4-? 5+?", {"blind": 3}),
    "the receiver itself stood still": (
        [(2.1, "tick", 0), (9.1, "tick", 0), (9.15, "queued", 3), (9.15, "pv", 4)],
        "3- 4+",
        {"passed over": 1},
    ),
    "it stood still and the middle is lost": (
        [(2.1, "tick", 0), (9.1, "pv", 3), (9.11, "pv", 8), (9.12, "pv", 9)],
        "3+ 4-? 5-? 6-? 7-? 8+ 9+",
        {"missing": 4},
    ),
    "it stood still and nothing has come": (
        [(2.1, "tick", 0), (5.1, "tick", 0), (5.15, "tick", 0), (5.25, "tick", 0)],
        "3-? 4+?",
        {"blind": 2},
    ),
    "late": ([(4.1, "tick", 0), (4.2, "pv", 3), (4.3, "pv", 4)], "3+? 4+", {"blind": 1, "late": 1}),
    "late for good": (
        [(4.2, "queued", 4), (4.2, "pv", 3), (4.3, "pv", 3)],
        "3- 4+",
        {"passed over": 1, "stale": 1},
    ),
    "late in a row": (
        [(5.1, "tick", 0), (5.2, "queued", 3), (5.2, "queued", 4), (5.2, "pv", 5)],
        "3-? 4+? 5+",
        {"blind": 2, "late": 2},
    ),
    "bad quality": (
        [(3, "pv", 3, NAN), (4, "pv", 4, 1e6), (5, "pv", 5, 99.0), (6, "pv", 6)],
        "3+? 4+? 5+? 6+",
        {"bad values": 1, "out of range": 2},
    ),
    "wrong tags": ([(3, "pv", 3, None), (4, "pv", 4)], "3-? 4+", {"wrong tags": 1, "missing": 1}),
    "after a pause a run begins": (
        [(3, "queued", 3), (50, "rest", 0), (50, "applied", 49), (50, "pv", 50)],
        "^50+",
        {},
    ),
    "dv is no number": ([(3, "dv", 3, NAN), (3, "pv", 3)], "3+", {"refused dv": 1}),
    "op_applied is no number": (
        [(3, "applied", 2, NAN), (3, "pv", 3)],
        "3+",
        {"refused op_applied": 1},
    ),
}


@pytest.mark.parametrize("case", REALTIME_TABLE)
def test_realtime(case: str) -> None:
    events, words, counts = REALTIME_TABLE[case]
    feed = Feed(REALTIME)
    for now, kind, stamp, *value in [*START, *events]:
        feed.event(now, kind, stamp, *value)
    assert feed.words == f"^1+ 2+ {words}"
    assert feed.counted() == {name: count for name, count in counts.items() if count}


def test_numbers_count_every_sample_once_whatever_came() -> None:
    for case, (events, _, _) in REALTIME_TABLE.items():
        feed = Feed(REALTIME)
        for now, kind, stamp, *value in [*START, *events]:
            feed.event(now, kind, stamp, *value)
        assert [sample.number for sample in feed.samples] == list(range(len(feed.samples))), case


def test_a_run_waits_for_the_op_in_force_but_not_for_ever() -> None:
    feed = Feed(REALTIME)
    feed.event(0, "sp", 0)
    for k in range(1, PATIENCE):
        feed.event(k, "pv", k)
        assert feed.samples == []
        assert feed.port.lacks == "op_applied"
    feed.event(PATIENCE, "pv", PATIENCE)
    (sample,) = feed.samples
    assert sample.begins
    assert sample.given.op is None


def test_a_run_begins_with_the_op_in_force() -> None:
    feed = Feed(REALTIME)
    feed.event(0, "sp", 0)
    feed.event(1, "pv", 1)
    feed.event(2, "applied", 1, 37.0)
    feed.event(2, "pv", 2)
    (sample,) = feed.samples
    assert (sample.begins, sample.answered, sample.stamp) == (True, True, 2 * S)
    assert sample.given.op == [37.0]


def test_without_a_set_point_nothing_is_stepped_and_it_is_said() -> None:
    feed = Feed(REALTIME)
    for k in range(1, 9):
        feed.event(k, "applied", k - 1)
        feed.event(k, "pv", k)
    state = feed.port
    assert (feed.samples, state.lacks, state.waiting) == ([], "sp", 8)
    feed.event(8.5, "sp", 0)
    feed.event(9, "applied", 8)
    feed.event(9, "pv", 9)
    assert feed.words == "^9+"


def test_every_sample_tells_what_the_valves_were_given_before_it() -> None:
    feed = Feed(REALTIME)
    feed.event(0, "sp", 0)
    for k in range(1, 5):
        feed.event(k, "applied", k - 1, 10.0 * k)
        feed.event(k, "pv", k)
    assert [float(s.given.op[0]) for s in feed.samples if s.given.op is not None] == [
        10.0,
        20.0,
        30.0,
        40.0,
    ]


def test_where_nobody_tells_own_op_that_was_late_or_for_a_sample_passed_over_is_unknown() -> None:
    feed = Feed(REALTIME)
    feed.event(0, "sp", 0)
    for k in range(1, PATIENCE + 2):
        feed.event(k, "pv", k)
    feed.port.sent(PATIENCE + 2.5)  # of the sample answered last
    for k in range(3):
        feed.event(9, "queued", PATIENCE + 2 + k)
    feed.event(9, "pv", PATIENCE + 5)
    feed.event(10, "pv", PATIENCE + 6)
    told = [(word(s), s.given.known) for s in feed.samples]
    assert told == [
        ("^3+", True),
        ("4+", True),
        ("5-", False),
        ("6-", False),
        ("7-", False),
        ("8+", False),
        ("9+", True),
    ]


def test_ages_and_samples_behind() -> None:
    feed = Feed(REALTIME)
    for now, kind, stamp in START:
        feed.event(now, kind, stamp)
    for k in (3, 4):
        feed.event(5, "queued", k)
    feed.event(5, "pv", 5)
    state = feed.port
    assert state.ages(7.0) == {"pv": 2.0, "sp": 7.0, "op_applied": 7.0}
    assert (state.behind, state.period) == (2, 1.0)
    feed.event(8, "pv", 8)
    assert feed.port.behind == 0


def test_a_pace_that_was_set_wrong_is_found_out() -> None:
    feed = Feed(dataclasses.replace(REALTIME, period=0.01))
    feed.event(0, "sp", 0)
    for k in range(1, 60):
        for tick in range(10):
            feed.event(k + tick / 10, "tick", 0)
        feed.event(k + 1, "applied", k - 1)
        feed.event(k + 1, "pv", k)
    late = feed.samples[-20:]
    assert [word(sample) for sample in late] == [f"{k}+" for k in range(40, 60)]


def test_fast_samples_are_waited_for_a_tenth_of_a_second_and_then_stepped_in_time() -> None:
    feed = Feed(dataclasses.replace(REALTIME, step=S // 100, period=0.01))
    for now, kind, stamp in ((0.0, "sp", 0), (0.0, "applied", 0.0), (0.01, "pv", 0.01)):
        feed.event(now, kind, stamp)
    feed.event(0.11, "tick", 0)
    assert len(feed.samples) == 1
    feed.event(0.1205, "tick", 0)
    assert feed.words == "^0.01+ " + " ".join(f"{k / 100:g}-?" for k in range(2, 11)) + " 0.11+?"
    feed.event(0.129, "pv", 0.12)
    assert word(feed.samples[-1]) == "0.12+"


def test_a_preview_is_held_against_the_range() -> None:
    port = InputPort(REALTIME)
    good = SetPointPreview((S,), np.array([[50.0]]))
    port.add_preview(good)
    for values in ([[1e9]], [[NAN]]):
        port.add_preview(SetPointPreview((S,), np.array(values)))
    port.add_preview(None)
    assert port.preview is good
    assert port.counts == {"refused sp_preview": 3}


# ---- nothing that arrives may stop what comes after it -----------------------------------------

stamps = st.one_of(
    st.integers(-20, 120).map(float),
    st.floats(-20.0, 120.0),
    st.sampled_from([-1e9, 0.0, 1e6, 4e9]),
)
values = st.one_of(st.none(), st.floats(), st.floats(0.0, 100.0))
kinds = st.sampled_from(["pv", "queued", "sp", "dv", "applied", "tick", "rest"])
junk = st.lists(st.tuples(st.floats(0.0, 30.0), kinds, stamps, values), max_size=60)
RECOVERED = SUCCESSION + 4  # samples
GOOD = 30


@given(junk, st.sampled_from([*LOCKSTEP, "realtime"]), st.floats(0.0, 100.0))
@example([(0.0, "pv", 4e9, 50.0)], "external", 0.0)
@example([(30.0, "pv", k, 50.0) for k in range(3)], "realtime", 3.0)
def test_after_any_junk_good_samples_are_stepped_again(
    events: list[tuple[float, str, float, float | None]], pace: str, first: float
) -> None:
    feed = Feed(LOCKSTEP.get(pace, REALTIME))
    now = 0.0
    for wait, kind, stamp, value in events:
        now += wait
        feed.event(now, kind, stamp, value)
    junk_samples = len(feed.samples)
    begin = round(first)
    shown, k = 0, 0
    while k < GOOD and shown < 3 * GOOD:
        now += 1.0
        shown += 1
        feed.event(now, "tick", 0)
        feed.good(now, begin + k)
        answered = [s.stamp for s in feed.samples if s.answered]
        in_turn = bool(answered) and answered[-1] == (begin + k) * S
        if k >= RECOVERED and pace == "realtime":
            assert in_turn
        # A plant in lockstep shows its sample again until it is answered.
        k += 1 if pace == "realtime" or in_turn else 0
    assert k == GOOD
    assert shown <= GOOD + SUCCESSION
    numbers = [sample.number for sample in feed.samples]
    assert numbers == list(range(len(numbers)))
    last = feed.samples[-1]
    assert np.isfinite(last.sp).all()
    assert len(feed.samples) - junk_samples <= 3 * GOOD + 200
