"""Loops in which an effect sets in half-way."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import Backlash, ExtraDelay, HeStiction, Lag
from stiction_ros.online.monitor.gap_monitor import MonitorRule
from stiction_studies.blind.late import ONSET, SAMPLES, Late, late_loop, watch
from stiction_studies.blind.scores.scoring import Score

QUIET = MonitorRule(monitor=True, monitor_growth=10.0)


@given(
    onset=st.integers(1, 40),
    inner=st.sampled_from([Backlash(3.0), HeStiction(2.0, 1.0), Lag(5.0), ExtraDelay(3.0)]),
)
def test_nothing_acts_before_the_onset_and_the_effect_from_rest_behind_it(
    onset: int, inner: Backlash
) -> None:
    values = 50.0 + np.cumsum(np.random.default_rng(onset).standard_normal(80))
    found = Late(inner, float(onset)).simulate(values)
    assert np.array_equal(found[:onset], values[:onset])
    alone = inner.simulate(values[onset:], float(values[onset - 1]))
    assert np.allclose(found[onset:], alone)


def test_the_seed_decides_everything() -> None:
    one, two = late_loop(500), late_loop(500)
    assert np.array_equal(one.record.pv, two.record.pv)
    assert one.truth == two.truth


@pytest.mark.trial
@pytest.mark.parametrize("seed", range(500, 504))
def test_before_the_onset_the_loop_is_the_healthy_one(seed: int) -> None:
    late, healthy = late_loop(seed), late_loop(seed, healthy=True)
    assert len(late.record) == SAMPLES
    assert np.array_equal(late.record.op[:ONSET], healthy.record.op[:ONSET])
    assert not np.array_equal(late.record.pv[ONSET:], healthy.record.pv[ONSET:])


def test_the_model_holds_nothing_of_what_sets_in() -> None:
    document = late_loop(500).model.to_mapping()
    assert not {"disturbances", "sensors", "provenance"} & document.keys()
    assert all(not valve["effects"] for valve in document["valves"])


def test_a_healthy_loop_without_alarm_is_quiet() -> None:
    found = watch(late_loop(500, healthy=True), QUIET)
    assert (found.score, found.early, found.delay) == (Score.QUIET, 0, None)
    assert found.looks == (19, 0)


@pytest.mark.trial
def test_an_effect_without_alarm_is_missed() -> None:
    found = watch(late_loop(110), QUIET)
    assert (found.score, found.delay, found.findings) == (Score.MISSED, None, ())
    assert found.looks == (7, 12)
