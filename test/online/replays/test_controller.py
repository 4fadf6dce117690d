"""The controller of a recorded run is told what the node was told."""

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.live import LiveController
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.replays.bag import ReplayBag, Signal
from stiction_ros.online.replays.controller import replay_controller
from stiction_ros.online.replays.result import Comparison

S = 10**9
SAMPLES = 60
NAN = float("nan")
MODEL = LoopModel.load(find_config("example1_process.loop.yaml"))
PV = 50.0 + 0.3 * np.sin(np.arange(SAMPLES) / 5.0)
SETTINGS = {"fit_first": 10**6, "horizon": 30}


def bag(signals: list[Signal]) -> ReplayBag:
    return ReplayBag("run", "", tuple(signals), None, None, {}, {}, {}, (), None, ())


def signal(kind: str, k: int, value: float) -> Signal:
    return Signal(kind, (k + 1) * S, ("V1" if kind.startswith("op") else "PV1",), (value,))


def run(
    pace: str, *, passed: range = range(0), lost: range = range(0), stuck: range = range(0)
) -> tuple[LiveControllerSettings, list[Signal]]:
    """A run whose samples were ``passed`` over, without PV, or with the valve's OP ``stuck``."""
    settings = LiveControllerSettings(**SETTINGS, pace=pace)
    live = LiveController(settings, MODEL)
    live.begin(np.array([47.0]))
    signals = [signal("op_applied", -1, 47.0)]
    given = 47.0
    for k in range(SAMPLES):
        if k:
            live.applied(np.array([given]))
        signals.append(signal("sp", k, 50.0))
        pv = np.array([NAN if k in lost else PV[k]])
        if k not in lost:
            signals.append(signal("pv", k, PV[k]))
        if k in passed:
            live.pass_over(pv)
        else:
            own = float(live.step(pv, np.array([50.0])).op[0])
            signals.append(signal("op", k, own))
            given = given if k in stuck else own
        signals.append(signal("op_applied", k, given))
    return settings, signals


def replayed(settings: LiveControllerSettings, signals: list[Signal]) -> Comparison:
    return replay_controller(bag(signals), settings, MODEL, (), S).op


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
def test_what_was_applied_counts(pace: str) -> None:
    settings, signals = run(pace, stuck=range(20, 24))
    assert replayed(settings, signals) == Comparison(SAMPLES, SAMPLES)
    untold = [one for one in signals if one.kind != "op_applied" or one.stamp == 0]
    assert replayed(settings, untold).difference.startswith("op at 2")


def test_samples_passed_over_and_without_pv_are_replayed_as_such() -> None:
    settings, signals = run("realtime", passed=range(30, 35), lost=range(40, 43))
    assert replayed(settings, signals) == Comparison(SAMPLES - 5, SAMPLES - 5)


def test_values_out_of_range_are_left_out_as_they_were_live() -> None:
    settings, signals = run("lockstep", lost=range(40, 43))
    wild = [signal("pv", k, 1e6) for k in range(40, 43)]
    found = replayed(settings, [*signals, *wild])
    assert found == Comparison(SAMPLES, SAMPLES)
