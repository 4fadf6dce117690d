"""Which rows are kept back."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.simulation.free_run import PHASES, FreeRun, Runs, join_records
from stiction_ros.discrepancy.steps.begin import with_surprises_fitted


def with_blow(at: int | None) -> Runs:
    """Return a record whose PV is hit at one sample."""
    sound = record(loop())
    pv = sound.pv.copy()
    if at is not None:
        pv[at] += 20.0
    return join_records(loop(), [dataclasses.replace(sound, pv=pv)])


def fitted(runs: Runs) -> Runs:
    return with_surprises_fitted(Baseline.of(FreeRun(loop(), runs)))


def test_what_nothing_foretells_is_fitted() -> None:
    held = int(np.flatnonzero(with_blow(None).kept_back(0, PHASES[0]))[10])
    runs = fitted(with_blow(held))
    assert runs.phases != with_blow(held).phases
    blocks = FreeRun(loop(), runs).blocks(0)
    assert blocks.train[held]
    assert blocks.held.any()


def test_what_is_fitted_already_moves_nothing() -> None:
    usual = with_blow(None)
    place = int(np.flatnonzero(~usual.kept_back(0, PHASES[0]))[200])
    for runs in (usual, with_blow(place)):
        assert fitted(runs).phases == usual.phases


@pytest.mark.parametrize("phase", PHASES)
def test_the_first_block_is_always_fitted(phase: int) -> None:
    kept = with_blow(None).kept_back(0, phase)
    assert not kept[:20].any()
    assert 0.2 < kept.mean() < 0.3
