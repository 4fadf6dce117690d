"""Where stems are recorded, they speak against effects that move them elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.free_run import FreeRun
from stiction_ros.discrepancy.search import CandidateFit
from stiction_ros.discrepancy.valve_candidates import ValveCandidate
from stiction_ros.effects import FloatArray

CONFIRMED = 0.5  # of the squared distance that may be left


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


def confirmed(run: FreeRun, fit: CandidateFit) -> bool:
    """Tell whether every record has a stem, and most of its distance from OP is that effect.

    A stem that is merely late, or smoother than OP, comes a little nearer by any bend.
    """
    candidate = fit.candidate
    if not isinstance(candidate, ValveCandidate):
        return False
    if any(record.stem is None for record in run.runs.records):
        return False
    stems = candidate.stems(run, fit.point[None, :])[:, 0]
    now = stem_misfit(run, candidate.valve, run.stems[:, candidate.valve])
    return stem_misfit(run, candidate.valve, stems) < CONFIRMED * now


def stem_misfit(run: FreeRun, valve: int, stems: FloatArray) -> float:
    """Return the sum of squared distances from the measured stems; 0 where none is recorded."""
    name, total = run.model.valve_names[valve], 0.0
    for record, rows in zip(run.runs.records, run.runs.slices, strict=True):
        if record.stem is not None:
            measured = record.stem[:, record.valves.index(name)]
            total += float(np.sum((stems[rows] - measured) ** 2))
    return total
