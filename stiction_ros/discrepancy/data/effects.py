"""Effects that the data themselves show: into the model, and out of the records."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.data.gate import DataFinding
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.effects import TimeShift, Tuning
from stiction_ros.loop import LoopModel


def corrected(runs: Runs, finding: DataFinding | None) -> Runs:
    """Return the records with a shift of PV against OP taken back; the last samples are lost."""
    if finding is None or not isinstance(finding.behaviour, TimeShift):
        return runs
    late = round(finding.behaviour.shift)
    pv, usable = runs.pv.copy(), runs.usable.copy()
    for rows in runs.slices:
        part = runs.pv[rows]
        pv[rows] = np.vstack([part[late:], np.tile(part[-1:], (late, 1))])
        usable[:, rows] = np.hstack(
            [runs.usable[:, rows][:, late:], np.zeros((len(usable), late), dtype=bool)]
        )
    return dataclasses.replace(runs, pv=pv, usable=usable)


def add_data_effects(model: LoopModel, findings: Sequence[DataFinding]) -> LoopModel:
    """Return the model with sensor effects and another tuning; a time shift is provenance alone."""
    for finding in findings:
        note = {
            "what": finding.effect,
            "at": finding.place,
            "by": "stiction gap",
            "delta_bic": round(finding.delta_bic, 2),
        }
        if finding.place != "data":
            model = model.with_effect(finding.place, finding.behaviour, **note)
            continue
        document = model.to_mapping()
        if isinstance(finding.behaviour, Tuning):
            document["controller"] = {
                "kind": "pi",
                "gain": finding.behaviour.gain,
                "integral_time": finding.behaviour.integral_time,
            }
        values = {key: v for key, v in finding.behaviour.to_mapping().items() if key != "effect"}
        document.setdefault("provenance", []).append(note | values)
        model = LoopModel.from_mapping(document, model.name)
    return model
