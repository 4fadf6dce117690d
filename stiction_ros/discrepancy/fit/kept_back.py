"""Which blocks are kept back: not those that hold nearly all of what nothing foretells."""

import dataclasses

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.noise import SURPRISE
from stiction_ros.discrepancy.simulation.free_run import PHASES, Runs
from stiction_ros.effects import FloatArray

MOST = 0.9  # of what is beyond chance, that the quarter of the rows that is kept back may hold


def with_surprises_fitted(base: Baseline) -> Runs:
    """Return the records, other blocks kept back where those hold all of what nothing foretells.

    Behind noise that forgets nothing, the step of a level is a single innovation. Kept back, it
    tells that something happened, but neither what nor how much.
    """
    runs, beyond, phases = base.run.runs, _beyond_chance(base), []
    for r, (rows, usual) in enumerate(zip(runs.slices, runs.phases, strict=True)):
        part = beyond[rows]
        kept = {phase: float(part[runs.kept_back(r, phase)].sum()) for phase in PHASES}
        most = kept[usual] > MOST * float(part.sum())
        phases.append(min(kept, key=kept.__getitem__) if most else usual)
    if tuple(phases) == runs.phases:
        return runs
    return dataclasses.replace(runs, phases=tuple(phases))


def _beyond_chance(base: Baseline) -> FloatArray:
    """Return by how much squared innovations exceed what is never chance, shape (N,)."""
    beyond = np.zeros(len(base.run.runs))
    for noise, blocks in zip(base.noise, base.blocks, strict=True):
        squared = (noise.innovations / noise.innovation_std) ** 2 - SURPRISE**2
        beyond += np.where(blocks.scored, np.maximum(squared, 0.0), 0.0)
    return beyond
