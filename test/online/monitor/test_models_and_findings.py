"""Which model is compared, and what becomes of windows that are looked into."""

import dataclasses
import sys
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from monitored_loops import RULE, WATCHED, loop, record, shifted

from stiction_ros.effects import Backlash, HeStiction
from stiction_ros.errors import InputError
from stiction_ros.identification import (
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.loop import LoopModel
from stiction_ros.online.estimator.live import EstimatorSettings, FitUpdate, LiveEstimator
from stiction_ros.online.monitor.gap_monitor import GapMonitor, MonitorRule, with_friction_of

SETTINGS = EstimatorSettings(fit_first=20, fit_every=10, fit_latency=5, confirmations=1)
SHIFTED = record(shifted(), 1200)


def live() -> LiveEstimator:
    return LiveEstimator(SETTINGS, *WATCHED)


def fit(verdict: VerdictKind = VerdictKind.STICKY) -> Identification:
    valve = ValveEstimate("V1", verdict, "he", 5.0, (4.5, 5.5), 2.0, (1.8, 2.2), 3.0, 0.0, 40, {})
    output = OutputModel("PV1", (-0.9,), {"V1": (0.1,)}, {"V1": 2}, 0.5, 0.01, 99.0, 90.0)
    return Identification(
        FitStatus.OK, "", "exact", 30, 1.0, 0.1, (valve,), (output,), np.zeros((30, 1))
    )


def fed(monitor: GapMonitor, first: int, last: int) -> None:
    for k in range(first, last):
        monitor.add(k, SHIFTED.op[k], SHIFTED.pv[k])


def model_after(update: FitUpdate, samples: int, given: LoopModel | None) -> LoopModel | None:
    """Return the model in force ``samples`` samples after the window of the fit."""
    monitor = GapMonitor(RULE, *WATCHED, given)
    fed(monitor, 0, update.end + 1)
    monitor.learn(live(), update)
    fed(monitor, update.end + 1, update.end + 1 + samples)
    return monitor.model


def frictions(model: LoopModel | None) -> list[str]:
    assert model is not None
    return [effect.effect for effect in model.valves[0].effects]


def test_the_given_model_gets_the_trusted_friction_when_the_latency_is_over() -> None:
    update = live().conclude(40, fit())
    assert frictions(model_after(update, 4, loop())) == []
    assert frictions(model_after(update, 5, loop())) == ["stiction"]


def test_the_given_model_keeps_its_process() -> None:
    found = model_after(live().conclude(40, fit()), 5, loop())
    assert found is not None
    assert found.to_mapping()["process"] == loop().to_mapping()["process"]


def test_without_a_model_the_loop_is_taken_as_the_first_fit_found_it() -> None:
    update = live().conclude(40, fit(VerdictKind.HEALTHY))
    assert update.loop_model is None
    assert model_after(update, 4, None) is None
    found = model_after(update, 5, None)
    assert found is not None
    assert found.to_mapping()["process"]["outputs"][0]["a"] == [-0.9]


def test_later_fits_without_a_new_loop_model_change_nothing() -> None:
    estimator = live()
    monitor = GapMonitor(RULE, *WATCHED)
    for end in (20, 30):
        monitor.learn(estimator, estimator.conclude(end, fit(VerdictKind.HEALTHY)))
    fed(monitor, 0, 26)
    first = monitor.model
    fed(monitor, 26, 60)
    assert monitor.model is first


def test_other_effects_of_a_valve_stay_beside_its_friction() -> None:
    given = loop().with_valve_effects({"V1": (HeStiction(9.0, 9.0), Backlash(2.0))})
    found = with_friction_of(given, loop().with_valve_effects({"V1": (HeStiction(5.0, 2.0),)}))
    assert [e.to_mapping() for e in found.valves[0].effects] == [
        Backlash(2.0).to_mapping(),
        HeStiction(5.0, 2.0).to_mapping(),
    ]


def test_a_shift_is_found_and_told_in_one_sentence() -> None:
    monitor = GapMonitor(RULE, *WATCHED, loop())
    fed(monitor, 0, 1050)
    assert monitor.text.endswith("looking for the effect")
    (found,) = monitor.collect()
    assert "PV1: " in found.text
    assert monitor.text.startswith(found.text)
    assert (monitor.looks, monitor.grown, monitor.runs) == (11, 1, 1)
    fed(monitor, 1050, 1100)
    assert monitor.collect() == []


class Later:
    """Futures that the test ends."""

    def __init__(self) -> None:
        self.futures: list[Future[Any]] = []

    def __call__(self, work: Any, *arguments: Any) -> Future[Any]:
        self.futures.append(Future())
        return self.futures[-1]


@pytest.mark.parametrize(
    ("error", "said"),
    [(InputError("too short"), "window not usable: too short"), (OSError("gone"), "OSError")],
)
def test_a_run_that_fails_is_a_finding(error: Exception, said: str) -> None:
    later = Later()
    monitor = GapMonitor(RULE, *WATCHED, loop(), later)
    fed(monitor, 0, 1100)
    assert monitor.collect() == []
    later.futures[0].set_exception(error)
    (found,) = monitor.collect()
    assert found.verdict is None
    assert said in found.text


def test_a_run_that_was_called_off_is_no_finding() -> None:
    later = Later()
    monitor = GapMonitor(RULE, *WATCHED, loop(), later)
    fed(monitor, 0, 1100)
    later.futures[0].cancel()
    assert monitor.collect() == []
    assert monitor.running == 0


@pytest.mark.parametrize(
    ("given", "text"), [(None, "no loop model yet"), (loop(), "no measurement yet")]
)
def test_what_is_missing_is_told(given: LoopModel | None, text: str) -> None:
    assert GapMonitor(RULE, *WATCHED, given).text == text


def test_a_fit_without_a_process_is_no_model() -> None:
    monitor = GapMonitor(RULE, *WATCHED)
    empty = dataclasses.replace(fit(VerdictKind.HEALTHY), outputs=())
    monitor.learn(live(), live().conclude(40, empty))
    assert monitor.text.startswith("no loop model yet: model identified for watched")


@pytest.mark.trial
def test_turned_on_again_it_has_found_nothing_yet() -> None:
    monitor = GapMonitor(RULE, *WATCHED, loop())
    fed(monitor, 0, 1050)
    monitor.collect()
    monitor.retune(MonitorRule())
    monitor.retune(RULE)
    assert (monitor.look, monitor.finding) == (None, None)
