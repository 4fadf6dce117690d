"""Loops and entries for the tests of the survey."""

from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.identification.result import (
    Cause,
    CauseKind,
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.intake.loop import Loop
from stiction_ros.records.record import Record
from stiction_ros.survey.entry import Cycling, Entry, Status


def unreadable(number: int) -> Loop:
    """Return a loop that is judged at once: it has a problem."""
    return Loop(f"FIC{number:03d}", (Path(f"{number}.csv"),), (), problem="has no column OP")


def entry(name: str, verdict: str = "sticky", cause: str = "valve", **rest: Any) -> Entry:
    """Return a row of a loop that was judged."""
    values: dict[str, Any] = {
        "samples": 1000,
        "sample_time": 1.0,
        "auto_share": 1.0,
        "saturated_share": 0.0,
        "oscillation": Cycling(60.0, 3.0, 1.5),
        "f_s": 2.0,
        "f_s_interval": (1.8, 2.2),
        "f_d": 1.0,
        "f_d_interval": (0.9, 1.1),
        "band_share": 0.5,
        "travel_per_hour": 200.0,
        "reversals_per_hour": 60.0,
        "probability": 0.9,
        "evidence": {"loop_gone": 0.5},
    }
    return Entry(
        name, (f"{name}.csv",), Status.OK, verdict=verdict, cause=cause, **{**values, **rest}
    )


def record(samples: int = 1200) -> Record:
    """Return signals that look like those of a valve that sticks."""
    time = np.arange(samples)
    op = 50.0 + 3.0 * (2.0 / np.pi) * np.arcsin(np.sin(2 * np.pi * time / 60.0))
    pv = 20.0 + np.where(np.sin(2 * np.pi * (time - 15) / 60.0) > 0.0, 1.0, -1.0)
    return Record(
        "FIC101", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None], np.full((samples, 1), 20.0)
    )


def identification(of: Record) -> Identification:
    """Return what identification might say of such a record."""
    valve = ValveEstimate(
        "V1", VerdictKind.STICKY, "he", 2.0, (1.8, 2.2), 1.0, (0.9, 1.1), 1.0, 50.0, 40, {}, 0.5
    )
    cause = Cause(CauseKind.VALVE, 60.0, 3.0, 1.0, "Without the friction nothing moves.")
    output = OutputModel("PV1", (-0.8,), {"V1": (0.2,)}, {"V1": 1}, 0.0, 0.1, 90.0, 80.0, cause)
    stem = of.op - 1.0
    return Identification(FitStatus.OK, "", "exact", len(of), 1.0, 0.1, (valve,), (output,), stem)


GAIN: dict[str, Any] = {
    "now": {
        "amplitude": 1.2,
        "period": 90.0,
        "iae_per_hour": 0.9,
        "travel_per_hour": 240.0,
        "moves_per_hour": 120.0,
        "reversals_per_hour": 120.0,
    },
    "options": [
        {
            "what": what,
            "amplitude": 0.1,
            "period": 90.0,
            "iae_per_hour": 0.2,
            "travel_per_hour": 90.0,
            "moves_per_hour": 40.0,
            "reversals_per_hour": 30.0,
            "interval": {"iae_per_hour": [0.1, 0.3]},
            "note": "Simulated.",
            "settings": {},
        }
        for what in ("service", "embedding", "retune", "leave")
    ],
}
"""A mapping of ``gain --json``."""
