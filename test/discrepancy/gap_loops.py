"""Small loops whose missing effect is known."""

import dataclasses

import numpy as np

from stiction_ros.effects import Behaviour
from stiction_ros.loop import LoopModel, PiController, SetPoints, simulate_closed_loop
from stiction_ros.records import Record

SAMPLES = 900


def loop(noise: float = 0.1) -> LoopModel:
    """Return a second-order loop with a delay of three samples."""
    return LoopModel.from_mapping(
        {
            "loop": "small",
            "sample_time": 1.0,
            "valves": [{"name": "V1", "limits": [0.0, 100.0], "effects": []}],
            "process": {
                "kind": "arx",
                "outputs": [
                    {
                        "name": "PV1",
                        "a": [-1.6, 0.64],
                        "b": {"V1": [0.03, 0.01]},
                        "delay": {"V1": 2},
                        "noise": {"std": noise, "enters": "measurement"},
                    }
                ],
            },
            "operating_point": {"op": {"V1": 50.0}, "pv": {"PV1": 50.0}},
            "controller": {"kind": "pi", "gain": 0.8, "integral_time": 12.0},
        }
    )


def record(
    model: LoopModel,
    seed: int = 1,
    samples: int = SAMPLES,
    *,
    moves: bool = True,
    stem: bool = False,
) -> Record:
    """Return a closed-loop record under the model's own controller."""
    random = np.random.default_rng([seed, 3])
    times = np.arange(0.0, samples, 110.0) if moves else np.zeros(1)
    sizes = random.uniform(3.0, 8.0, len(times)) * random.choice((-1.0, 1.0), len(times))
    values = 50.0 + np.where(times > 0.0, sizes, 0.0)
    assert model.controller is not None
    controller = PiController(model.controller, 1.0, 50.0, (0.0, 100.0))
    points = SetPoints(("PV1",), times, values[:, None])
    recorded = simulate_closed_loop(model, controller, points, samples, seed).record
    return recorded if stem else dataclasses.replace(recorded, stem=None)


def with_cause(place: str, effect: Behaviour, seed: int = 1) -> tuple[LoopModel, Record]:
    """Return the model without the effect, and a record of the loop with it."""
    model = loop()
    return model, record(model.with_effect(place, effect), seed)


def without_controller(model: LoopModel) -> LoopModel:
    """Return the model with no recorded tuning."""
    document = model.to_mapping()
    document.pop("controller")
    return LoopModel.from_mapping(document)


def without_set_points(recorded: Record) -> Record:
    """Return the record as a historian without SP would give it."""
    return dataclasses.replace(recorded, sp=None)
