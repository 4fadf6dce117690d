"""Which rows are kept back, and which are not scored."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record
from scipy.signal import lfilter

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.simulation.free_run import PHASES, FreeRun, Runs, join_records
from stiction_ros.discrepancy.steps.begin import with_surprises_fitted, without_spikes


def with_blow(at: int | None) -> Runs:
    """Return a record whose PV is hit at one sample."""
    sound = record(loop())
    pv = sound.pv.copy()
    if at is not None:
        pv[at] += 20.0
    return join_records(loop(), [dataclasses.replace(sound, pv=pv)])


def fitted(runs: Runs) -> Runs:
    return with_surprises_fitted(Baseline.of(FreeRun(loop(), runs))).run.runs


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


def scored(runs: Runs) -> Runs:
    return without_spikes(Baseline.of(FreeRun(loop(), runs))).run.runs


@pytest.mark.parametrize("sizes", [(9.0,), (9.0, -2.0, 4.0)])
def test_readings_that_are_off_alone_are_not_scored(sizes: tuple[float, ...]) -> None:
    sound, at = record(loop()), [300, 500, 503]
    pv = sound.pv.copy()
    for size, k in zip(sizes, at, strict=False):
        pv[k, 0] += size
    runs = scored(join_records(loop(), [dataclasses.replace(sound, pv=pv)]))
    assert np.flatnonzero(~runs.usable[0]).tolist() == at[: len(sizes)]
    assert runs.alone == (len(sizes),)


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_a_spike_on_a_slope_is_one_and_steps_and_bends_are_none(memory: float) -> None:
    time, random = np.arange(400.0), np.random.default_rng(3)
    pv = np.where(time < 100.0, 0.0, np.minimum(2.0 * (time - 100.0), 400.0))  # two bends
    pv += np.where(time < 350.0, 0.0, 30.0)
    pv += lfilter([0.1], [1.0, -memory], random.normal(size=400))
    pv[200] += 9.0
    recorded = dataclasses.replace(record(loop()).part(0, 400), pv=pv[:, None])
    runs = scored(join_records(loop(), [recorded]))
    assert np.flatnonzero(~runs.usable[0]).tolist() == [200]
