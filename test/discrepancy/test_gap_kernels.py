"""Compiled code gives what the plain formulas give."""

import warnings

import numpy as np
import pytest
from gap_loops import loop, record
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from stiction_ros.config_files import find_config
from stiction_ros.discrepancy.candidate.base import Response
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.misfit import misfit
from stiction_ros.discrepancy.likelihood.least_squares import coefficients, projector
from stiction_ros.discrepancy.likelihood.noise import Blocks, fit_noise
from stiction_ros.discrepancy.simulation.free_run import FreeRun, join_records
from stiction_ros.discrepancy.simulation.responses import filtered
from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel, simulate_open_loop
from stiction_ros.signals.autoregression import whiten

COUNT = 400
TRAIN = (np.arange(COUNT) % 50 < 37) & (np.arange(COUNT) >= 7)
BLOCKS = Blocks(TRAIN, ~TRAIN & (np.arange(COUNT) >= 7))
SEEDS = st.integers(0, 10_000)


def drawn(seed: int, *shape: int) -> FloatArray:
    return np.random.default_rng(seed).standard_normal(shape)


@given(SEEDS, st.integers(0, 6), st.floats(1e-8, 1e8))
def test_least_squares_is_that_of_numpy(seed: int, columns: int, unit: float) -> None:
    matrix, target = drawn(seed, columns, 60), drawn(seed + 1, 60)
    matrix[:1] *= unit
    wanted = np.linalg.lstsq(matrix.T, target, rcond=None)[0] if columns else np.zeros(0)
    assert coefficients(matrix, target) == pytest.approx(wanted, rel=1e-9, abs=1e-12 / unit)


def test_a_column_that_repeats_another_adds_nothing() -> None:
    matrix = drawn(1, 3, 60)
    matrix[2] = 2.0 * matrix[0] - matrix[1]
    wanted = np.linalg.lstsq(matrix.T, drawn(2, 60), rcond=1e-10)[0]
    assert coefficients(matrix, drawn(2, 60)) @ matrix == pytest.approx(wanted @ matrix)


@given(SEEDS, st.integers(0, 6))
def test_a_basis_is_orthonormal_and_holds_the_columns(seed: int, count: int) -> None:
    columns = drawn(seed, 60, count)
    columns = np.hstack([columns, columns[:, :2] @ np.ones((min(count, 2), 1)), np.zeros((60, 1))])
    basis = projector(columns)
    assert basis.shape == (60, np.linalg.matrix_rank(columns))
    assert basis.T @ basis == pytest.approx(np.eye(basis.shape[1]), abs=1e-12)
    assert basis @ (basis.T @ columns) == pytest.approx(columns, abs=1e-12)


def test_a_column_that_is_zero_on_the_fitted_rows_has_no_size() -> None:
    columns = np.column_stack([np.ones(COUNT), np.arange(COUNT) == 0, np.arange(COUNT) == 1])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = fit_noise(drawn(5, COUNT), columns.astype(float), BLOCKS)
    assert fit.coefficients[1:].tolist() == [0.0, 0.0]


def baseline() -> Baseline:
    return Baseline.of(FreeRun(loop(), join_records(loop(), [record(loop(), samples=COUNT)])))


def squares(base: Baseline, gap: FloatArray, columns: FloatArray, ar: FloatArray) -> float:
    """Return Σ n log of the squares that whitened least squares of the columns leaves."""
    rows = base.blocks[0].train
    inner, target = whiten(columns, ar)[rows], whiten(gap, ar)[rows]
    left = target - inner @ np.linalg.lstsq(inner, target, rcond=1e-10)[0]
    return float(rows.sum() * np.log(left @ left))


def test_misfits_of_shifts_are_those_of_least_squares() -> None:
    base, ar = baseline(), np.array([0.6, 0.1])
    shift = np.cumsum(drawn(6, COUNT, 5), axis=0)
    found = misfit(base, base.run.gap, Response({0: shift}), {0: ar})
    gap = base.run.gap[:, 0]
    wanted = [squares(base, gap - shift[:, g], base.columns[0], ar) for g in range(5)]
    assert found == pytest.approx(wanted, rel=1e-9)


def test_misfits_of_sizes_are_those_of_least_squares() -> None:
    base, ar = baseline(), np.array([0.6, 0.1])
    sizes = drawn(7, COUNT, 5, 3)
    found = misfit(base, base.run.gap, Response({}, {0: sizes}), {0: ar})
    gap, shared = base.run.gap[:, 0], base.columns[0]
    wanted = [squares(base, gap, np.hstack([sizes[:, g], shared]), ar) for g in range(5)]
    assert found == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("points", [1, 4])
def test_a_process_filters_deviations_from_the_first_stem(points: int) -> None:
    stems, taps = 50.0 + drawn(8, COUNT, points), np.array([0.0, 0.0, 0.3, -0.1])
    denominator = np.array([1.0, -1.2, 0.3])
    more = drawn(11, COUNT)
    wanted = lfilter(taps, denominator, stems - stems[:1], axis=0)
    wanted += lfilter([1.0], denominator, more)[:, None]
    assert filtered(taps, denominator, stems, more) == pytest.approx(wanted, abs=1e-9)


def test_a_valve_of_the_tank_that_does_not_reach_an_output_leaves_it() -> None:
    model = LoopModel.load(find_config("tank.loop.yaml"))
    recorded = simulate_open_loop(model, 50.0 + drawn(10, COUNT, 2), 0).record
    run = FreeRun(model, join_records(model, [recorded]))
    moved = run.stems[:, 1:] + 10.0 * drawn(9, COUNT, 2)
    reached = [np.ptp(run.drive(i, 1, moved) - run.forced[:, i : i + 1]) > 0.0 for i in range(2)]
    assert reached == [run.responses.reaches(i, 1) for i in range(2)] == [False, True]
