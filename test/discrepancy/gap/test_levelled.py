"""The free run as a reader sees it."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record

from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.measure import free_run_gap, measure_gap
from stiction_ros.discrepancy.simulation.free_run import FreeRun


def base() -> Baseline:
    model = loop()
    return Baseline.of(FreeRun(model, open_gate(model, [record(model, samples=600)])[0]))


def test_level_and_start_are_those_of_the_free_run_whatever_the_noise_took_for_them() -> None:
    fitted = base()
    away = 7.0 * fitted.columns[0] @ np.ones(fitted.columns[0].shape[1])
    noise = dataclasses.replace(fitted.noise[0], residual=fitted.noise[0].residual + away)
    moved = dataclasses.replace(fitted, noise=(noise,))
    assert measure_gap(moved)[0].free_run_rmse > 5.0 * measure_gap(fitted)[0].free_run_rmse
    found, plain = free_run_gap(moved)[0], free_run_gap(fitted)[0]
    assert found.free_run_rmse == pytest.approx(plain.free_run_rmse)
    assert found.floor_one_step == measure_gap(fitted)[0].floor_one_step


def test_under_white_noise_nothing_changes() -> None:
    fitted = base()
    if len(fitted.noise[0].ar):
        pytest.skip("the noise has a memory")
    assert free_run_gap(fitted)[0].free_run_rmse == pytest.approx(
        measure_gap(fitted)[0].free_run_rmse
    )
