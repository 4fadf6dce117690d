"""How sure figures are: together, all around, and where the likelihood jumps."""

import dataclasses
import math

import numpy as np
import pytest
from gap_loops import loop, record

from stiction_ros.discrepancy.candidate.wave import DISTURBANCE, SineCandidate, StepCandidate
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.fit.uncertainty import (
    Region,
    bootstrap_intervals,
    likelihood_intervals,
)
from stiction_ros.discrepancy.measures import SMOOTH, STEPPED
from stiction_ros.discrepancy.simulation.free_run import FreeRun, join_records
from stiction_ros.effects import FloatArray

PERIOD = 40.0


def base_beside(added: FloatArray, unscored: FloatArray | None = None) -> Baseline:
    model = loop()
    runs = join_records(model, [record(model)])
    pv, usable = runs.pv + added[:, None], runs.usable.copy()
    if unscored is not None:
        pv, usable = pv + unscored[:, None], usable & (unscored == 0.0)
    runs = dataclasses.replace(runs, pv=pv, usable=usable)
    return Baseline.of(FreeRun(model, runs))


def sine(phase: float) -> tuple[Baseline, CandidateFit]:
    time = np.arange(900.0)
    base = base_beside(0.3 * np.sin(2.0 * math.pi * time / PERIOD + phase))
    wave = SineCandidate.of(base.run, DISTURBANCE, 0, np.array([1.0 / PERIOD]))
    return base, fit_candidate(base, base.run.gap, wave)


def step(unscored: FloatArray | None = None) -> tuple[Baseline, CandidateFit]:
    base = base_beside(np.where(np.arange(900) >= 400, 0.3, 0.0), unscored)
    candidate = StepCandidate.of(base.run, DISTURBANCE, 0, np.array([400.0]))
    return base, fit_candidate(base, base.run.gap, candidate)


def test_the_size_of_a_sine_is_as_sure_at_any_phase() -> None:
    widths = []
    for phase in (0.0, 0.25 * math.pi, 0.5 * math.pi):
        base, fit = sine(phase)
        low, high = likelihood_intervals(base, fit)["amplitude"]
        assert low < 0.3 < high
        widths.append(high - low)
    assert widths == pytest.approx([widths[0]] * 3, rel=0.15)


def test_rows_that_are_not_scored_make_no_noise() -> None:
    wild = np.zeros(900)
    wild[600:603] = 50.0
    widths = []
    for unscored in (None, wild):
        base, fit = step(unscored)
        low, high = bootstrap_intervals(base, fit, 40, np.random.default_rng(1))["size"]
        widths.append(high - low)
    assert widths[1] < 1.5 * widths[0]


def test_what_another_effect_may_do_otherwise_makes_a_size_less_sure() -> None:
    base, fit = step()
    low, high = likelihood_intervals(base, fit)["size"]
    ramp = np.clip((np.arange(900.0) - 300.0) / 200.0, 0.0, 1.0)[:, None]
    less = likelihood_intervals(base, fit, [ramp])["size"]
    assert less[0] < low < high < less[1]
    assert less[1] - less[0] > 1.5 * (high - low)


def test_the_bound_of_a_moment_is_that_of_a_step() -> None:
    base, fit = step()
    assert SMOOTH < Region.around(base, fit).excess.max() <= STEPPED
    base, fit = sine(0.0)
    assert 0.5 * SMOOTH < Region.around(base, fit).excess.max() <= SMOOTH
