"""Free runs and step responses of what was identified."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.pages.plot import KINDS, Curve, over_time
from stiction_ros.pages.signals import Units
from stiction_ros.records.record import Record
from stiction_ros.signals.free_run import step_response as answer_to_step
from stiction_ros.signals.polynomials import largest_root


def responses(
    outputs: Sequence[Mapping[str, Any]], record: Record, units: Units, truth: LoopModel | None
) -> str:
    """Return a figure of each output with its responses to a step of each stem by 1 %."""
    if not outputs:
        return ""
    length = settling(outputs, truth)
    drawn = []
    for i, output in enumerate(outputs):
        curves = [
            Curve(f"{valve} → {output['name']}", kind, step_response(output, valve, length))
            for valve, kind in zip(record.valves, itertools.cycle(KINDS), strict=False)
        ]
        if truth is not None:
            curves += [
                Curve("simulated process", "whole", true_response(truth, i, j, length))
                for j in range(len(record.valves))
            ]
        drawn.append(
            over_time(
                f"Response of {output['name']} to a step of the stem by 1 %, from the step on.",
                np.arange(float(length)) * record.sample_time,
                curves,
                units.axis(output["name"]),
            )
        )
    return "".join(drawn)


def step_response(output: Mapping[str, Any], valve: str, samples: int) -> FloatArray:
    """Return the response, (N,), of an output of ``identify --json`` to a stem step of 1 %."""
    if valve not in output["b"]:
        return np.zeros(samples)
    delay = int(output["delay"].get(valve, 0))
    return answer_to_step(output["a"], output["b"][valve], delay, samples)


def true_response(model: LoopModel, output: int, valve: int, samples: int) -> FloatArray:
    """Return the response, shape (N,), of the true loop, linearised, to a stem step of 1 %."""
    return model.process.linear(model.sample_time).step_responses(samples)[:, output, valve]


def settling(outputs: Sequence[Mapping[str, Any]], truth: LoopModel | None) -> int:
    """Return after how many samples the slowest of the shown models has settled."""
    if truth is not None:
        linear = truth.process.linear(truth.sample_time)
        radius = float(np.abs(np.linalg.eigvals(linear.a)).max())
    else:
        radius = max(largest_root(np.array([1.0, *output["a"]])) for output in outputs)
    if not 0.0 < radius < 1.0:
        return 100
    return int(np.clip(math.ceil(math.log(0.01) / math.log(radius)), 20, 400))
