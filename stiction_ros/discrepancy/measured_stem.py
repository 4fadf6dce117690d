"""Where stems are recorded, they speak against effects that move them elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.free_run import FreeRun
from stiction_ros.discrepancy.search import CandidateFit
from stiction_ros.discrepancy.valve_candidates import ValveCandidate
from stiction_ros.effects import FloatArray


def not_contradicted(run: FreeRun, fits: Sequence[CandidateFit]) -> list[CandidateFit]:
    """Return the fits but for those whose stem is further from the measured one than now."""
    kept = []
    for fit in fits:
        if isinstance(fit.candidate, ValveCandidate):
            valve = fit.candidate.valve
            stems = fit.candidate.stems(run, fit.point[None, :])[:, 0]
            if stem_misfit(run, valve, stems) > stem_misfit(run, valve, run.stems[:, valve]):
                continue
        kept.append(fit)
    return kept


def stem_misfit(run: FreeRun, valve: int, stems: FloatArray) -> float:
    """Return the sum of squared distances from the measured stems; 0 where none is recorded."""
    name, total = run.model.valve_names[valve], 0.0
    for record, rows in zip(run.runs.records, run.runs.slices, strict=True):
        if record.stem is not None:
            measured = record.stem[:, record.valves.index(name)]
            total += float(np.sum((stems[rows] - measured) ** 2))
    return total
