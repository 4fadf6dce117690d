"""The loop model that a plant would have, as the mapping of its YAML."""

import dataclasses
from typing import Any

import numpy as np

from stiction_studies.field.hidden.plants import FINE, Plant
from stiction_studies.field.hidden.simulation import AT_REST, OP_LIMITS, Base

OFF = (0.03, 0.1)
"""By which share gain, time constants and dead time of a model are off."""


@dataclasses.dataclass(frozen=True)
class Noise:
    """Noise of a loop, engineering units."""

    white: float  # standard deviation of what the transmitter adds
    equation: float = 0.0  # of what enters the process's equation; 0 is none
    coloured: float = 0.0  # of first-order noise on the output; 0 is none
    memory: float = 1.0  # its time constant, s


@dataclasses.dataclass(frozen=True)
class Kept:
    """What transmitter and record add to the output of a loop."""

    std: float  # standard deviation, engineering units
    memory: float = 0.0  # time constant in samples of the record; 0 is white


def off(random: np.random.Generator, plant: Plant, sample_time: float) -> Plant:
    """Return the plant as a model knows it that is a few per cent wrong in everything."""

    def wrong(value: float) -> float:
        share = float(random.uniform(*OFF)) * float(random.choice([-1.0, 1.0]))
        return value * (1.0 + share)

    fine = sample_time / FINE
    return dataclasses.replace(
        plant,
        gain=wrong(plant.gain),
        lags=tuple(wrong(lag) for lag in plant.lags),
        lead=wrong(plant.lead),
        dead_time=round(wrong(plant.dead_time) / fine) * fine,
    )


def given_model(
    base: Base, plant: Plant, noise: Noise | None, interval: float, tuning_known: bool
) -> dict[str, Any]:
    """Return the mapping of a loop model.

    Args:
        base: the healthy loop.
        plant: as the model knows it.
        noise: as the model declares it; None where it does not.
        interval: between two samples of the record, s.
        tuning_known: whether it holds the tuning.
    """
    a, b, delay = plant.sampled(interval, FINE * round(interval / base.sample_time))
    output: dict[str, Any] = {
        "name": "PV1",
        "a": a.tolist(),
        "b": {"V1": b.tolist()},
        "delay": {"V1": delay},
    }
    if noise is not None and noise.equation:
        output["noise"] = {"std": noise.equation, "enters": "equation"}
    elif noise is not None:
        output["noise"] = {"std": noise.white, "enters": "measurement"}
    model: dict[str, Any] = {
        "loop": "hidden",
        "sample_time": interval,
        "valves": [{"name": "V1", "limits": list(OP_LIMITS), "effects": []}],
        "process": {"kind": "arx", "outputs": [output]},
        "operating_point": {"op": {"V1": AT_REST}, "pv": {"PV1": AT_REST}},
    }
    if noise is not None and noise.coloured:
        model["disturbances"] = [
            {"output": "PV1", "effect": "coloured", "std": noise.coloured, "tau": noise.memory}
        ]
    if tuning_known:
        model["controller"] = {
            "kind": "pi",
            "gain": base.tuning.gain,
            "integral_time": base.tuning.integral_time,
        }
    return model
