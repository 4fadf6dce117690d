"""Tags that report when they change become samples, by the written rule."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_maps import OP, PV, SP, at, bad, good, loop_tags

from stiction_ros.opcua.sampling import (
    LOCAL_OVERRIDE,
    LoopSampler,
    PlantClock,
    PlantSample,
    TagQuality,
    TagReading,
    quality_of,
)


class Scans:
    """A control system that scans once a second; the wall clock is 50 s behind the plant's."""

    def __init__(self, sampler: LoopSampler | None = None) -> None:
        self.sampler = sampler or LoopSampler(loop_tags())
        self.found: list[PlantSample] = []
        self.now = 0.0

    def first(self, pv: float = 0.0, op: float = 40.0) -> None:
        for tag, value in ((PV, pv), (SP, 1.0), (OP, op)):
            self.sampler.hear(tag, good(value, -0.5, first=True), 0.0)

    def scan(self, k: float, pv: float | None = None, delay: float = 0.02) -> None:
        now = self.now = max(self.now + 1.0, 1.0 + k) if k >= 0 else self.now + 1.0
        self.sampler.hear(PV, good(10.0 + k if pv is None else pv, k), now + delay)
        self.look(now + delay)

    def look(self, now: float, alive: bool = True) -> list[PlantSample]:
        found = self.sampler.due(now, alive)
        self.found += found
        return found


def test_each_scan_is_one_sample_as_soon_as_it_is_there() -> None:
    scans = Scans()
    scans.first()
    for k in range(20):
        scans.scan(k)
    assert [s.stamp for s in scans.found] == [at(k) for k in range(20)]
    assert [s.pv[0] for s in scans.found] == [10.0 + k for k in range(20)]
    assert not +scans.sampler.counts


def test_a_pv_that_does_not_change_is_held_and_tells_its_age() -> None:
    scans = Scans()
    scans.first()
    scans.scan(0)
    scans.scan(1)
    for tenth in range(100):
        scans.look(2.02 + tenth / 10)
    held = scans.found[2:]
    assert len(held) == 9
    assert {s.pv[0] for s in held} == {11.0}
    assert [round(s.pv_age[0]) for s in held] == list(range(1, 10))
    assert {s.pv_quality for s in held} == {(TagQuality.GOOD,)}


def test_a_quiet_plant_begins_at_the_newest_stamp() -> None:
    scans = Scans()
    scans.first(pv=5.0)
    for tenth in range(80):
        scans.look(tenth / 10)
    assert len(scans.found) >= 4
    assert {s.pv[0] for s in scans.found} == {5.0}


def test_values_that_are_not_good_are_never_numbers() -> None:
    scans = Scans()
    scans.first()
    scans.scan(0)
    for k, quality in enumerate((TagQuality.BAD, TagQuality.UNCERTAIN), start=1):
        scans.sampler.hear(PV, bad(k, quality), 1.02 + k)
        scans.look(1.02 + k)
    scans.scan(3, math.inf)
    scans.scan(4)
    assert [math.isnan(s.pv[0]) for s in scans.found] == [False, True, True, True, False]
    assert scans.found[1].pv_quality == (TagQuality.BAD,)
    assert scans.sampler.counts["bad"] == 2


def test_uncertain_values_count_where_the_map_says_so() -> None:
    scans = Scans(LoopSampler(loop_tags(uncertain=True)))
    scans.first()
    scans.scan(0)
    scans.sampler.hear(PV, bad(1, TagQuality.UNCERTAIN), 2.0)
    assert scans.look(2.02)[0].pv[0] == 7.0


def test_a_silent_server_gives_samples_without_values() -> None:
    scans = Scans()
    scans.first()
    scans.scan(0)
    found = scans.look(6.0, alive=False)
    assert len(found) >= 3
    assert all(math.isnan(s.pv[0]) and math.isnan(s.op_before[0]) for s in found)
    assert {s.pv_quality for s in found} == {(TagQuality.SILENT,)}


def test_op_belongs_to_the_sample_for_most_of_which_it_acted() -> None:
    scans = Scans()
    scans.first(op=40.0)
    scans.scan(0)
    scans.sampler.hear(OP, good(41.0, 0.4), 1.42)  # early in sample 0
    scans.scan(1)
    scans.sampler.hear(OP, good(42.0, 1.7), 2.72)  # late in sample 1: it is that of sample 2
    scans.scan(2)
    scans.scan(3)
    assert [s.op_before[0] for s in scans.found] == [40.0, 41.0, 41.0, 42.0]


def test_stamps_of_the_past_are_refused_and_ten_in_succession_begin_anew() -> None:
    scans = Scans()
    scans.first()
    for k in range(5):
        scans.scan(k)
    for k in range(9):
        scans.sampler.hear(PV, good(-1.0, -500.0 + k), 6.0 + k)
        scans.look(6.0 + k)
    assert scans.sampler.counts["past"] == 9
    assert all(s.pv[0] != -1.0 for s in scans.found)
    assert np.isnan([s.pv[0] for s in scans.found[-5:]]).all()  # what was said before is doubted
    for k in range(9, 30):
        scans.sampler.hear(PV, good(-1.0, -500.0 + k), 6.0 + k)
        scans.look(6.0 + k)
    assert scans.sampler.counts["new_runs"] == 1
    assert scans.found[-1].pv[0] == -1.0
    assert scans.found[-1].stamp == at(-500.0 + 29)


def test_a_tag_whose_clock_differs_from_the_others_is_not_paired() -> None:
    scans = Scans()
    scans.first()
    for k in range(60):
        scans.sampler.hear(OP, good(40.0 + k, k), 1.0 + k)
        scans.scan(k if k < 5 else k - 900.0)
        scans.look(1.02 + k)
    assert scans.sampler.counts["new_runs"] == 1
    assert scans.found[-1].pv[0] == 10.0 + 59 - 900
    assert math.isnan(scans.found[-1].op_before[0])


def test_a_stamp_of_the_future_is_refused() -> None:
    scans = Scans()
    scans.first()
    for k in range(5):
        scans.scan(k)
    scans.sampler.hear(PV, good(-1.0, 300.0), 5.5)
    for k in range(5, 9):
        scans.scan(k)
    assert scans.sampler.counts["ahead"] == 1
    assert [s.pv[0] for s in scans.found] == [10.0 + k for k in range(9)]


def test_the_first_report_of_a_new_subscription_tells_the_present() -> None:
    scans = Scans()
    scans.first()
    for k in range(4):
        scans.scan(k)
    scans.look(8.0, alive=False)
    scans.sampler.hear(PV, good(3.5, 0.0, first=True), 8.1)
    assert scans.sampler.counts["past"] == 0
    assert scans.look(9.6)[-1].pv[0] == 3.5


def test_the_grid_moves_to_scans_that_lie_beside_it() -> None:
    scans = Scans()
    scans.first()
    for k in range(5):
        scans.scan(k)
    for k in range(5, 40):
        scans.scan(k + 0.4)
    tail = scans.found[-10:]
    assert all(s.stamp % 1_000_000_000 == 400_000_000 for s in tail)
    assert all(s.pv_age[0] == 0.0 for s in tail)


def test_many_changes_between_two_samples_leave_the_last() -> None:
    scans = Scans()
    scans.first()
    for i in range(5000):
        scans.sampler.hear(PV, good(float(i), i / 1000), 1.02 + i / 1000)
        if i % 10 == 0:
            scans.look(1.02 + i / 1000)
    assert [s.stamp for s in scans.found] == [at(k) for k in range(len(scans.found))]
    assert len(scans.found) >= 4
    for sample in scans.found[1:]:
        assert 0.0 <= sample.pv[0] * 1e6 - (sample.stamp - at(0)) + 1e8 <= 2.1e8


def test_scans_that_come_together_are_told_sample_by_sample() -> None:
    scans = Scans()
    scans.first()
    for k in range(3):
        scans.scan(k)
    for k in range(3, 6):
        scans.sampler.hear(PV, good(10.0 + k, k), 6.4)
    scans.look(6.4)
    for k in range(6, 10):
        scans.scan(k)
    assert [s.stamp for s in scans.found] == [at(k) for k in range(10)]
    assert [s.pv[0] for s in scans.found] == [10.0 + k for k in range(10)]


@given(st.lists(st.floats(0.0, 0.4), min_size=30, max_size=60))
def test_no_sample_is_lost_doubled_or_out_of_order_however_late(delays: list[float]) -> None:
    scans = Scans()
    scans.first()
    for k, delay in enumerate(delays):
        scans.scan(k, delay=delay)
    scans.look(len(delays) + 3.0)
    steps = np.diff([s.stamp for s in scans.found])
    assert (steps == 1_000_000_000).all()
    assert {s.pv[0] for s in scans.found} <= {10.0 + k for k in range(len(delays))}


@given(st.integers(0, 2**32 - 1))
def test_only_good_codes_are_good(code: int) -> None:
    good_code = code >> 30 == 0 and code & 0xFFFF0000 != LOCAL_OVERRIDE
    assert (quality_of(code) is TagQuality.GOOD) is good_code


def test_the_plant_clock_takes_the_freshest_stamp() -> None:
    clock = PlantClock(1.0)
    assert clock.now(0.0) is None
    for k, delay in enumerate((0.3, 0.1, 0.5)):
        clock.hear(at(k), k + delay)
    assert clock.now(10.0) == pytest.approx(at(9.9), abs=1000)


def test_a_text_has_no_number() -> None:
    assert math.isnan(TagReading("AUTO", TagQuality.GOOD, 0).number)


def test_a_pv_that_is_reported_after_other_tags_is_waited_for() -> None:
    scans = Scans()
    scans.sampler.hear(SP, good(1.0, 0.0, first=True), 0.0)
    assert not scans.look(5.0)
    scans.sampler.hear(PV, good(7.0, 0.0, first=True), 5.0)
    scans.look(6.0)
    assert scans.found
    assert all(sample.pv[0] == 7.0 for sample in scans.found)


def test_a_pv_that_is_never_reported_is_not_waited_for_without_end() -> None:
    scans = Scans()
    scans.sampler.hear(SP, good(1.0, 0.0, first=True), 0.0)
    assert not scans.look(9.0)
    scans.look(13.0)
    scans.look(14.0)
    assert scans.found
    assert all(math.isnan(sample.pv[0]) for sample in scans.found)
