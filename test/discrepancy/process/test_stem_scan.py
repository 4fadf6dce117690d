"""The scan over stems finds what plain least squares finds, stem by stem and delay by delay."""

from __future__ import annotations

import numpy as np
import pytest
from gap_loops import loop, record
from scipy.signal import lfilter

from stiction_ros.discrepancy.process.free_equation import Equation, Problem
from stiction_ros.discrepancy.process.refit import (
    equations_of,
    longest_delay,
    problems_of,
    with_common_rows,
)
from stiction_ros.discrepancy.process.stem_scan import Prefilter, StemScan
from stiction_ros.discrepancy.simulation.free_run import FreeRun, Runs, join_records
from stiction_ros.effects import FloatArray, HeStiction

DELAYS = range(4)
PREFILTERS = {
    "none": Prefilter.of(),
    "innovations": Prefilter(np.array([1.0, -0.6]), np.array([1.0, -1.5, 0.58])),
}


def two_records() -> Runs:
    model = loop()
    parts = record(model, seed=3, samples=420)
    return with_common_rows(join_records(model, [parts.part(0, 200), parts.part(200, 420)]), model)


def problem_of(runs: Runs) -> tuple[Problem, Equation]:
    run = FreeRun(loop(), runs)
    return problems_of(run)[0], equations_of(loop())[0]


def stems_of(runs: Runs) -> FloatArray:
    op = runs.op[:, 0]
    moved = [HeStiction(f, 0.5).simulate(op, float(op[0]), 1.0) for f in (1.0, 2.0)]
    return np.column_stack([op, *moved])


def direct(
    problem: Problem, own: Equation, stem: FloatArray, delay: int, prefilter: Prefilter
) -> float:
    """Return the least sum of squares of the filtered equation, all columns written out."""
    columns = [problem.y, problem.late(problem.y, 1), problem.late(problem.y, 2)]
    starts = np.array([stem[rows.start] for rows in problem.runs.slices])
    for k in range(len(own.b[0])):
        late = np.zeros(len(stem))
        for rows, start in zip(problem.runs.slices, starts, strict=True):
            shifted = stem[rows] - start
            late[rows.start + 1 + delay + k : rows.stop] = shifted[: -(1 + delay + k)]
        columns.append(late)
    for rows in problem.runs.slices:
        columns.append(np.zeros(len(stem)))
        columns[-1][rows] = 1.0
        for k in range(len(prefilter.denominator) - 1):
            columns.append(np.zeros(len(stem)))
            columns[-1][rows.start + k] = 1.0
    table = np.column_stack(columns)
    parts = [
        lfilter(prefilter.numerator, prefilter.denominator, table[rows], axis=0)
        for rows in problem.runs.slices
    ]
    passed = np.concatenate(parts)[problem.blocks.train]
    inner = passed[:, 1:]
    rest = passed[:, 0] - inner @ np.linalg.lstsq(inner, passed[:, 0], rcond=None)[0]
    return float(rest @ rest)


@pytest.mark.parametrize("name", sorted(PREFILTERS))
def test_the_scan_is_least_squares(name: str) -> None:
    runs = two_records()
    problem, own = problem_of(runs)
    stems = stems_of(runs)
    scan = StemScan(problem, own, 0, DELAYS, PREFILTERS[name])
    expected = [
        [direct(problem, own, stem, delay, PREFILTERS[name]) for delay in DELAYS]
        for stem in stems.T
    ]
    assert scan.energy(stems) == pytest.approx(np.array(expected), rel=1e-6)


def test_rows_that_are_kept_back_change_nothing() -> None:
    runs = two_records()
    problem, own = problem_of(runs)
    energy = StemScan(problem, own, 0, DELAYS, PREFILTERS["none"]).energy(stems_of(runs))
    held = np.flatnonzero(problem.blocks.held)
    last = [k for k in held if not problem.blocks.train[k : k + 3].any()]
    problem.y[last] += 50.0
    again = StemScan(problem, own, 0, DELAYS, PREFILTERS["none"]).energy(stems_of(runs))
    assert again == pytest.approx(energy, rel=1e-9)


def test_all_delays_are_judged_over_the_same_rows() -> None:
    model = loop()
    runs = with_common_rows(join_records(model, [record(model)]), model)
    counts = []
    for delay in range(longest_delay(model) + 1):
        document = model.to_mapping()
        document["process"]["outputs"][0]["delay"] = {"V1": delay}
        other = type(model).from_mapping(document)
        counts.append(int(FreeRun(other, runs).blocks(0).train.sum()))
    assert len(set(counts)) == 1


def test_every_record_begins_with_fitted_rows() -> None:
    run = FreeRun(loop(), join_records(loop(), [record(loop(), samples=300)] * 5))
    blocks = run.blocks(0)
    first = [np.flatnonzero(blocks.train[rows] | blocks.held[rows])[0] for rows in run.runs.slices]
    assert all(
        blocks.train[rows][place] for rows, place in zip(run.runs.slices, first, strict=True)
    )
