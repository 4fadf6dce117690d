"""Identifications made by hand, so that tests of examples need no search."""

import dataclasses

import numpy as np

from stiction_ros.identification import (
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.processes import ArxProcess
from stiction_studies.examples import Example


def perfect(example: Example) -> Identification:
    """Return the identification that says exactly what is true; the process must be ARX."""
    process = example.truth.process
    assert isinstance(process, ArxProcess)
    assert example.record.stem is not None
    outputs = tuple(
        OutputModel(e.name, e.a, e.b, e.delay, e.bias, 0.01, 99.0, 98.0) for e in process.equations
    )
    valves = []
    for name in example.record.valves:
        f_s, f_d = example.friction(name)
        verdict = VerdictKind.STICKY if f_s > 0.0 else VerdictKind.HEALTHY
        ends = (max(f_s - 0.1, 0.0), f_s + 0.1), (max(f_d - 0.1, 0.0), f_d + 0.1)
        valves.append(
            ValveEstimate(
                name, verdict, "he", f_s, ends[0], f_d, ends[1], f_s - f_d, 50.0, 40, {"moves": 40}
            )
        )
    return Identification(
        FitStatus.OK,
        "",
        "exact",
        len(example.record),
        example.record.sample_time,
        0.1,
        tuple(valves),
        outputs,
        np.array(example.record.stem),
    )


def moved(found: Identification, static: float, delay: int = 0) -> Identification:
    """Return ``found`` with f_S of the first valve and all delays moved."""
    first = found.valves[0]
    valve = dataclasses.replace(first, static_friction=first.static_friction + static)
    outputs = tuple(
        dataclasses.replace(o, delay={v: d + delay for v, d in o.delay.items()})
        for o in found.outputs
    )
    return dataclasses.replace(found, valves=(valve, *found.valves[1:]), outputs=outputs)
