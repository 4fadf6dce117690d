"""Small loops under PI control for the monitor, quick to simulate."""

import dataclasses
from concurrent.futures import Future

import numpy as np

from stiction_ros.effects import BiasStep, HeStiction
from stiction_ros.loop import LoopModel, PiController, PiTuning, SetPoints, simulate_closed_loop
from stiction_ros.online.monitor.gap_monitor import GapLook, GapMonitor, MonitorRule
from stiction_ros.records import Record

RULE = MonitorRule(monitor=True, monitor_window=300, monitor_period=50, monitor_baseline=400)
LEAD = RULE.lead
FIRST = LEAD + 400  # samples until the baseline is there
ONSET = 1000
WATCHED = ("watched", ("V1",), ("PV1",), 1.0)


def loop(noise: float = 0.1) -> LoopModel:
    """Return a first-order loop with a delay of two samples."""
    return LoopModel.from_mapping(
        {
            "loop": "watched",
            "sample_time": 1.0,
            "valves": [{"name": "V1", "limits": [0.0, 100.0], "effects": []}],
            "process": {
                "kind": "arx",
                "outputs": [
                    {
                        "name": "PV1",
                        "a": [-0.8],
                        "b": {"V1": [0.2]},
                        "delay": {"V1": 1},
                        "noise": {"std": noise, "enters": "measurement"},
                    }
                ],
            },
            "operating_point": {"op": {"V1": 50.0}, "pv": {"PV1": 50.0}},
        }
    )


def sticky(f_s: float = 4.0, f_d: float = 1.0) -> LoopModel:
    return loop().with_valve_effects({"V1": (HeStiction(f_s, f_d),)})


def shifted(size: float = 1.0) -> LoopModel:
    return loop().with_effect("sensor:PV1", BiasStep(float(ONSET), size))


def record(plant: LoopModel, samples: int = 2000, seed: int = 1) -> Record:
    """Return a record with a set-point move every 90 samples, without stem."""
    times = np.arange(0.0, samples, 90.0)
    sizes = np.random.default_rng([seed, 5]).uniform(-8.0, 8.0, len(times))
    sizes[0] = 0.0  # begins at rest, its stem where OP is
    points = SetPoints(("PV1",), times, 50.0 + sizes[:, None])
    controller = PiController(PiTuning(0.6, 6.0), 1.0, 50.0, (0.0, 100.0))
    run = simulate_closed_loop(plant, controller, points, samples, seed)
    return dataclasses.replace(run.record, stem=None)


def monitor(rule: MonitorRule = RULE, model: LoopModel | None = None) -> GapMonitor:
    """Return a monitor that knows ``model``, by default the loop without anything wrong.

    Nobody looks into its windows.
    """
    return GapMonitor(rule, *WATCHED, model or loop(), lambda *_: Future())


def looks(made: GapMonitor, recorded: Record, first: int = 0) -> list[GapLook]:
    """Return every measurement of the record's samples from ``first`` on."""
    found = [made.add(k, recorded.op[k], recorded.pv[k]) for k in range(first, len(recorded))]
    return [look for look in found if look is not None]
