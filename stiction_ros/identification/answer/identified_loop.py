"""The identified loop as a loop model, which plant, controller and ``gap`` load."""

import dataclasses
import math
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.closed_loop.closed_loop import close_loop
from stiction_ros.identification.closed_loop.scaled_loop import (
    EXACT,
    free_run,
    scaled,
    scaled_process,
)
from stiction_ros.identification.result import FitStatus, Identification, OutputModel, ValveEstimate
from stiction_ros.loop import LoopModel
from stiction_ros.processes import Noise
from stiction_ros.records.record import Record
from stiction_ros.signals.controller_recovery import RecoveredController

FIGURES = 10
"""Digits that are written: enough for the poles of any process."""


def identified_loop(record: Record, found: Identification, name: str) -> LoopModel:
    """Return the loop with friction, process, noise and, where there is one, its controller.

    The valves have the friction that the process was identified with, also where the verdict on
    it is open; the provenance says what the verdict is. PV's noise is split in a white part of
    the measurement and a part with memory, a disturbance. The operating point is the mean of the
    record, and the loop starts as the record does; where the process then leaves PV, it rests at
    the mean and starts there. No range of the instruments is written: a record shows where PV
    was, not where it may be.

    Raises:
        InputError: there is no model, or the process grows without end.
    """
    if found.status is not FitStatus.OK:
        raise InputError(f"there is no loop to write: {found.reason}", where=record.name)
    op0 = record.op.mean(axis=0)
    pv0 = record.pv.mean(axis=0)
    biases = [_bias(record, i, model) for i, model in enumerate(found.outputs)]
    rests = _rests(record, found)
    noises = [_noise(rest) for rest in rests.T]
    controller = _controller(record, found)
    valves: list[dict[str, Any]] = [
        {"name": valve.name, "effects": _effects(valve)} for valve in found.valves
    ]
    document: dict[str, Any] = {
        "loop": name,
        "sample_time": record.sample_time,
        "valves": valves,
        "process": {
            "kind": "arx",
            "outputs": [
                dataclasses.replace(model.equation(Noise(white)), bias=bias).to_mapping()
                for model, bias, (white, _, _) in zip(found.outputs, biases, noises, strict=True)
            ],
        },
        "disturbances": [
            {"output": model.name, "effect": "coloured", "std": std, "tau": lag * found.sample_time}
            for model, (_, std, lag) in zip(found.outputs, noises, strict=True)
            if std > 0.0
        ],
        "operating_point": {"op": _named(record.valves, op0), "pv": _named(record.outputs, pv0)},
        "initial": {
            "stem": _named(record.valves, found.stem[0]),
            "pv": _named(record.outputs, record.pv[0]),
        },
        "provenance": [
            {
                "what": "process",
                "by": "stiction identify",
                "method": found.method,
                "record": record.name,
                "samples": found.samples,
                "fit_free_run": {model.name: model.fit_free_run for model in found.outputs},
            },
            *(_of_valve(valve, record) for valve in found.valves if _effects(valve)),
        ],
    }
    if controller is not None:
        law, section = controller
        document["controller"] = section
        document["provenance"].append(_of_controller(law, record))
        if all(map(math.isfinite, law.limits)):
            valves[0]["limits"] = [float(limit) for limit in law.limits]
    loop = LoopModel.from_mapping(_rounded(document), name)
    if _repeats(loop, record, found.stem):
        return loop
    del document["initial"]
    for output in document["process"]["outputs"]:
        output["bias"] = 0.0
    return LoopModel.from_mapping(_rounded(document), name)


def _effects(valve: ValveEstimate) -> list[dict[str, Any]]:
    """Return the friction that the process was identified with; [] for a valve without."""
    law = valve.behaviour()
    return [] if law is None else [law.to_mapping()]


def _bias(record: Record, output: int, model: OutputModel) -> float:
    """Return the constant of the equation about the means of OP and PV."""
    drive = sum(
        sum(model.b[valve]) * float(record.op[:, j].mean()) for j, valve in enumerate(record.valves)
    )
    return model.bias + drive - (1.0 + sum(model.a)) * float(record.pv[:, output].mean())


def _repeats(loop: LoopModel, record: Record, stem: FloatArray) -> bool:
    """Tell whether the process, from where the loop starts, follows PV under the stems.

    Slow poles that zeros all but cancel remember more than the first sample tells.
    """
    state, none = loop.process.rest(loop.stem_start, loop.pv_start), np.zeros(0)
    noise = np.zeros(len(loop.outputs))
    run = np.empty_like(record.pv)
    for k, row in enumerate(stem):
        run[k] = loop.process.output(state)
        state = loop.process.advance(state, row, none, noise)
    off: FloatArray = np.sqrt(np.mean((run - record.pv) ** 2, axis=0))
    return bool((off <= record.pv.std(axis=0)).all())


def _rests(record: Record, found: Identification) -> FloatArray:
    """Return what the process, driven by the estimated stems, leaves of PV, shape (N, p)."""
    loop = scaled(record, found.stem, EXACT)
    if loop is None:
        raise InputError("OP or PV does not move in automatic", where=record.name)
    run = free_run(scaled_process(found.outputs, record.valves, loop), loop, loop.stem)
    rest = (loop.pv - run)[slice(*loop.longest)] * loop.pv_scale
    if not np.isfinite(rest).all():
        raise InputError("the identified process grows without end", where=record.name)
    return np.asarray(rest - rest.mean(axis=0))


def _noise(rest: FloatArray) -> tuple[float, float, float]:
    """Return white noise and first-order noise that have the first three autocovariances.

    Args:
        rest: noise about its mean, shape (n,).

    Returns:
        Standard deviation of the white part; of the other; its time constant, samples.
    """
    whole, one, two = (float(rest[: len(rest) - k] @ rest[k:]) / len(rest) for k in range(3))
    if not 0.0 < two < one:
        return math.sqrt(whole), 0.0, 0.0
    keep = two / one
    memory = min(one / keep, whole)
    return math.sqrt(whole - memory), math.sqrt(memory), -1.0 / math.log(keep)


def _controller(
    record: Record, found: Identification
) -> tuple[RecoveredController, dict[str, Any]] | None:
    """Return the PI controller of a loop of one valve and one output, where it shows."""
    if (len(record.valves), len(record.outputs)) != (1, 1):
        return None
    (loop,) = close_loop(record, found).valves
    law = loop.controller
    if law is None or not loop.output:
        return None
    time = law.integral_time * record.sample_time
    if not (math.isfinite(time) and time > 0.0 and law.gain):
        return None
    return law, {"kind": "pi", "gain": law.gain, "integral_time": time}


def _of_valve(valve: ValveEstimate, record: Record) -> dict[str, Any]:
    return {
        "valve": valve.name,
        "effect": "stiction",
        "by": "stiction identify",
        "from": record.name,
        "verdict": valve.verdict.value,
        "f_s_interval": list(valve.static_interval),
        "f_d_interval": list(valve.dynamic_interval),
        **{f"{key}_interval": list(ends) for key, ends in valve.further_intervals.items()},
    }


def _of_controller(law: RecoveredController, record: Record) -> dict[str, Any]:
    """Return where the controller comes from, with what a PI in velocity form does not say."""
    return {
        "what": "controller",
        "by": "stiction identify",
        "from": record.name,
        "r_squared": law.r_squared,
        "lag": law.lag,
        "smoothing": law.smoothing,
        "derivative": float(law.coefficients[2]),
    }


def _named(names: tuple[str, ...], values: FloatArray) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _rounded(value: Any) -> Any:
    """Return a document with the figures that are written, plain floats."""
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(each) for each in value]
    if isinstance(value, float):
        return float(f"{value:.{FIGURES}g}")
    return value
