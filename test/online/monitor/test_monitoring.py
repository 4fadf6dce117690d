"""Which model is compared, and what becomes of windows that are looked into."""

import dataclasses
import sys
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from monitored_loops import RULE, loop, record, shifted

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
from stiction_ros.online.monitor.gap_monitor import MonitorRule
from stiction_ros.online.monitor.monitoring import Monitoring, with_friction_of

SETTINGS = EstimatorSettings(fit_first=20, fit_every=10, fit_latency=5, confirmations=1)
SHIFTED = record(shifted(), 1200)


def live() -> LiveEstimator:
    return LiveEstimator(SETTINGS, "watched", ["V1"], ["PV1"], 1.0)


def fit(verdict: VerdictKind = VerdictKind.STICKY) -> Identification:
    valve = ValveEstimate("V1", verdict, "he", 5.0, (4.5, 5.5), 2.0, (1.8, 2.2), 3.0, 0.0, 40, {})
    output = OutputModel("PV1", (-0.9,), {"V1": (0.1,)}, {"V1": 2}, 0.5, 0.01, 99.0, 90.0)
    return Identification(
        FitStatus.OK, "", "exact", 30, 1.0, 0.1, (valve,), (output,), np.zeros((30, 1))
    )


def fed(monitoring: Monitoring, first: int, last: int) -> None:
    for k in range(first, last):
        monitoring.add(k, SHIFTED.op[k], SHIFTED.pv[k])


def model_after(update: FitUpdate, samples: int, given: LoopModel | None) -> LoopModel | None:
    """Return the model in force ``samples`` samples after the window of the fit."""
    monitoring = Monitoring(RULE, live(), given)
    fed(monitoring, 0, update.end + 1)
    monitoring.learn(update)
    fed(monitoring, update.end + 1, update.end + 1 + samples)
    return monitoring.monitor.model


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
    monitoring = Monitoring(RULE, estimator)
    for end in (20, 30):
        monitoring.learn(estimator.conclude(end, fit(VerdictKind.HEALTHY)))
    fed(monitoring, 0, 26)
    first = monitoring.monitor.model
    fed(monitoring, 26, 60)
    assert monitoring.monitor.model is first


def test_other_effects_of_a_valve_stay_beside_its_friction() -> None:
    given = loop().with_valve_effects({"V1": (HeStiction(9.0, 9.0), Backlash(2.0))})
    found = with_friction_of(given, loop().with_valve_effects({"V1": (HeStiction(5.0, 2.0),)}))
    assert [e.to_mapping() for e in found.valves[0].effects] == [
        Backlash(2.0).to_mapping(),
        HeStiction(5.0, 2.0).to_mapping(),
    ]


def test_a_shift_is_found_and_told_in_one_sentence() -> None:
    monitoring = Monitoring(RULE, live(), loop())
    fed(monitoring, 0, 1050)
    assert monitoring.text.endswith("looking for the effect")
    (found,) = monitoring.collect()
    assert "PV1: " in found.text
    assert monitoring.text.startswith(found.text)
    assert (monitoring.looks, monitoring.grown, monitoring.runs) == (11, 1, 1)
    fed(monitoring, 1050, 1100)
    assert monitoring.collect() == []


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
    monitoring = Monitoring(RULE, live(), loop(), later)
    fed(monitoring, 0, 1100)
    assert monitoring.collect() == []
    later.futures[0].set_exception(error)
    (found,) = monitoring.collect()
    assert found.verdict is None
    assert said in found.text


def test_a_run_that_was_called_off_is_no_finding() -> None:
    later = Later()
    monitoring = Monitoring(RULE, live(), loop(), later)
    fed(monitoring, 0, 1100)
    later.futures[0].cancel()
    assert monitoring.collect() == []
    assert monitoring.running == 0


@pytest.mark.parametrize(
    ("given", "text"), [(None, "no loop model yet"), (loop(), "no measurement yet")]
)
def test_what_is_missing_is_told(given: LoopModel | None, text: str) -> None:
    assert Monitoring(RULE, live(), given).text == text


def test_a_fit_without_a_process_is_no_model() -> None:
    monitoring = Monitoring(RULE, live())
    empty = dataclasses.replace(fit(VerdictKind.HEALTHY), outputs=())
    monitoring.learn(live().conclude(40, empty))
    assert monitoring.text.startswith("no loop model yet: model identified for watched")


@pytest.mark.trial
def test_turned_on_again_it_has_found_nothing_yet() -> None:
    monitoring = Monitoring(RULE, live(), loop())
    fed(monitoring, 0, 1050)
    monitoring.collect()
    monitoring.retune(MonitorRule())
    monitoring.retune(RULE)
    assert (monitoring.look, monitoring.finding) == (None, None)
