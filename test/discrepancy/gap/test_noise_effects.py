"""A noise beyond the declared one: its law, where it enters, and its figures."""

import dataclasses

import pytest
from gap_loops import with_cause

from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.noise_effects import noise_effects
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Behaviour, ColouredDisturbance, RandomWalkDisturbance


@pytest.mark.parametrize("frozen", [0, 40])
@pytest.mark.parametrize(
    ("place", "noise"),
    [("disturbance:PV1", ColouredDisturbance(0.3, 20.0)), ("load:V1", RandomWalkDisturbance(0.15))],
)
def test_the_law_that_wandered_is_told_first(place: str, noise: Behaviour, frozen: int) -> None:
    model, recorded = with_cause(place, noise)
    pv = recorded.pv.copy()
    pv[300 : 300 + frozen] = pv[300]  # values that are no measurements
    runs, _ = open_gate(model, [dataclasses.replace(recorded, pv=pv)])
    (declared,) = declared_noise(model)
    assert declared is not None
    best = noise_effects(Baseline.of(FreeRun(model, runs)), 0, declared)[0]
    assert (best.place, best.behaviour.effect) == (place, noise.effect)
    for key, true in figures_of(noise).items():
        low, high = best.intervals[key]
        assert low < true < high
