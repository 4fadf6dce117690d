"""When the gap counts as grown, and which windows are looked into."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from monitored_loops import FIRST, LEAD, ONSET, RULE, looks, loop, monitor, record, shifted, sticky

from stiction_ros.effects import ExtraDelay
from stiction_ros.loop import LoopModel
from stiction_ros.online.monitor.gap_monitor import GapMonitor, MonitorRule

HEALTHY = record(loop())
SHIFTED = record(shifted())
# A gap that stays: what the window holds does not take it up.
SLOW = record(loop().with_effect("process:PV1", ExtraDelay(6.0)))
LATE = dataclasses.replace(
    HEALTHY,
    op=np.vstack([HEALTHY.op[:ONSET], SLOW.op[ONSET:]]),
    pv=np.vstack([HEALTHY.pv[:ONSET], SLOW.pv[ONSET:]]),
)


def test_nothing_is_measured_while_it_is_off() -> None:
    assert looks(monitor(dataclasses.replace(RULE, monitor=False)), HEALTHY) == []


def test_nothing_is_measured_without_a_model() -> None:
    assert looks(GapMonitor(RULE, "watched", ("V1",), ("PV1",), 1.0), HEALTHY) == []


def test_the_gap_is_measured_every_period_from_the_baseline_on() -> None:
    ends = [look.end for look in looks(monitor(), HEALTHY)]
    assert ends == list(range(FIRST - 1, 2000, 50))


def test_windows_have_the_length_asked_for() -> None:
    assert {look.end + 1 - look.begin for look in looks(monitor(), HEALTHY)} == {300}


def test_a_healthy_loop_is_left_alone() -> None:
    found = looks(monitor(), HEALTHY)
    assert not any(look.grown or look.job for look in found)
    assert {look.text for look in found} == {"gap as in the baseline"}


def test_a_shifted_sensor_shows_at_once_and_is_gone_with_the_window() -> None:
    ends = [look.end for look in looks(monitor(), SHIFTED) if look.grown]
    assert ends == list(range(ONSET + 49, ONSET + 299, 50))


def test_a_gap_that_stays_is_looked_into_until_a_window_lies_behind_the_alarm() -> None:
    found = looks(monitor(), LATE)
    grown = [look.end for look in found if look.grown]
    assert grown == list(range(grown[0], 2000, 50))
    alarm = grown[0]
    assert [look.end for look in found if look.job] == [alarm, alarm + 150, alarm + 300]


def test_the_window_of_a_job_is_the_one_that_was_measured() -> None:
    (look, *_) = [look for look in looks(monitor(), LATE) if look.job]
    model, window = look.job or (None, HEALTHY)
    assert model is not None
    assert (round(window.start), len(window)) == (look.begin, look.end + 1 - look.begin)
    assert np.array_equal(window.pv, LATE.pv[look.begin : look.end + 1])


def test_a_growth_that_does_not_matter_is_no_alarm() -> None:
    tolerant = dataclasses.replace(RULE, monitor_growth=9.0)
    assert not any(look.grown for look in looks(monitor(tolerant), SHIFTED))


def test_after_missed_samples_the_window_is_filled_again_and_the_baseline_kept() -> None:
    made = monitor()
    before = [made.add(k, HEALTHY.op[k], HEALTHY.pv[k]) for k in range(800)]
    made.restart()
    after = looks(made, HEALTHY, 800)
    assert after[0].end == 800 + LEAD + 300 - 1
    last = [look for look in before if look is not None][-1]
    assert after[0].outputs[0].baseline == last.outputs[0].baseline


def test_no_window_holds_many_samples_in_a_row_that_lack() -> None:
    made, ends = monitor(), []
    for k in range(1600):
        pv = np.array([np.nan]) if 895 <= k <= 900 else HEALTHY.pv[k]
        look = made.add(k, HEALTHY.op[k], pv)
        ends += [] if look is None else [look.end]
    assert [end for end in ends if 900 <= end < 901 + LEAD + 300 - 1] == []
    assert ends[-1] == 1599


def test_another_length_begins_anew() -> None:
    made = monitor()
    looks(made, HEALTHY)
    made.retune(dataclasses.replace(RULE, monitor_window=400))
    assert looks(made, HEALTHY)[0].end == 200 + 400 - 1


def test_another_period_keeps_window_and_baseline() -> None:
    made = monitor()
    looks(made, HEALTHY)
    made.retune(dataclasses.replace(RULE, monitor_period=10))
    assert made.add(2009, HEALTHY.op[0], HEALTHY.pv[0]) is not None


def test_turned_on_again_it_takes_another_baseline() -> None:
    made = monitor()
    looks(made, HEALTHY)
    made.retune(MonitorRule())
    made.retune(RULE)
    assert looks(made, HEALTHY)[0].end == FIRST - 1


def test_another_model_is_measured_on_the_same_baseline() -> None:
    recorded = record(sticky())
    made = monitor()
    for k in range(900):
        made.add(k, recorded.op[k], recorded.pv[k])
    made.use(sticky(), 900)
    look = next(look for look in looks(made, recorded, 900))
    assert look.outputs[0].baseline < 0.2
    assert not look.grown


def test_a_calmer_stretch_under_another_model_becomes_the_baseline() -> None:
    random = np.random.default_rng(1)
    noisy = np.where(np.arange(2000) < 600, 1.0, 0.0)[:, None] * random.standard_normal((2000, 1))
    recorded = dataclasses.replace(HEALTHY, pv=HEALTHY.pv + noisy)
    made = monitor()
    made.use(loop(), 700)
    found = {look.end: look.outputs[0].baseline for look in looks(made, recorded)}
    assert found[1049] > 0.5
    assert found[1099] == pytest.approx(0.1, rel=0.15)


def test_a_worse_stretch_under_another_model_does_not_become_the_baseline() -> None:
    made = monitor()
    made.use(loop(), 950)
    found = looks(made, SHIFTED)
    assert len({look.outputs[0].baseline for look in found}) == 1


def test_a_model_of_another_loop_is_a_failure_and_no_exception() -> None:
    document = loop().to_mapping()
    document["process"]["outputs"][0]["name"] = "PV9"
    document["operating_point"]["pv"] = {"PV9": 50.0}
    found = looks(monitor(model=LoopModel.from_mapping(document)), HEALTHY)
    assert found
    assert {look.grown for look in found} == {False}
    assert all("has no output 'PV9'" in look.text for look in found)
