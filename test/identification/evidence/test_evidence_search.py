import dataclasses

import numpy as np
import pytest
from evidence_loops import he, pi_loop
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.identification.evidence.accepted import Unseen, accepted
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.search import Found, search
from stiction_ros.identification.kernels.scan import best_apart
from stiction_ros.records.record import Record

STATIC, DYNAMIC = 3.0, 1.0


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem.of(pi_loop(STATIC, DYNAMIC))


@pytest.fixture(scope="module")
def found(problem: Problem) -> Found:
    return search(problem)


def test_stems_are_those_of_the_law(problem: Problem) -> None:
    span = problem.span[0]
    shares = np.array([[STATIC, DYNAMIC]]) / span
    stem = problem.stems(0, shares, 0.0)[0] * problem.scale[0] * span
    assert stem == pytest.approx(he(problem.op[0] * span, STATIC, DYNAMIC), abs=1e-9)


def test_rows_are_means_of_the_samples() -> None:
    record = pi_loop(STATIC, DYNAMIC)
    slow = Problem.of(record, rate=4)
    assert slow.rows == len(record) // 4
    shares = np.array([[STATIC, DYNAMIC]]) / slow.span[0]
    stem = slow.stems(0, shares, 0.0)[0] * slow.scale[0] * slow.span[0]
    fast = he(slow.op[0] * slow.span[0], STATIC, DYNAMIC)
    assert stem == pytest.approx(fast.reshape(-1, 4).mean(axis=1), abs=1e-9)


def test_the_friction_is_found_and_beats_none_by_far(problem: Problem, found: Found) -> None:
    assert found.best.friction[0] * problem.span[0] == pytest.approx([STATIC, DYNAMIC], abs=0.1)
    assert found.ideal.loss - found.best.loss > 100.0


def test_nothing_that_was_met_is_better_than_the_best(found: Found) -> None:
    losses = [one.loss for one in found.met]
    assert losses == sorted(losses)
    assert found.best.loss == losses[0]


def test_an_ideal_valve_gives_no_evidence_of_friction() -> None:
    found = search(Problem.of(pi_loop(0.0, 0.0, seed=1)))
    assert found.ideal.loss - found.best.loss < 15.0


@settings(max_examples=4)
@given(
    st.sampled_from([0.05, 20.0, -3.0]),
    st.sampled_from([0.0, 50.0]),
    st.sampled_from([1e-3, -40.0]),
)
def test_units_change_no_answer(op_unit: float, op_zero: float, pv_unit: float) -> None:
    record = pi_loop(STATIC, DYNAMIC, samples=400)
    other = dataclasses.replace(
        record, op=op_unit * record.op + op_zero, pv=pv_unit * record.pv - 7.0, sp=None
    )
    one, two = search(Problem.of(record)), search(Problem.of(other))
    assert two.best.friction == pytest.approx(one.best.friction, rel=1e-3)
    gains = [each.ideal.loss - each.best.loss for each in (one, two)]
    assert gains[1] == pytest.approx(gains[0], abs=0.5)


@pytest.mark.parametrize("seed", range(12))
def test_units_leave_no_trace_in_what_is_searched(seed: int) -> None:
    """Samples as a historian keeps them lie on a lattice, where a turned digit turns many."""
    random = np.random.default_rng(seed)
    op, pv = (np.cumsum(random.standard_normal((750, 1))).round(2)[:, None] for _ in range(2))
    record = Record("kept", 10.0, ("V1",), ("PV1",), 50.0 + op, 3.0 + pv)
    other = dataclasses.replace(record, op=20.0 * record.op + 50.0, pv=1e-3 * record.pv + 7.0)
    for rate in (1, 4):
        one, two = (Problem.of(each, rate=rate) for each in (record, other))
        assert np.array_equal(one.op, two.op)
        assert np.array_equal(one.pv, two.pv)
        assert np.array_equal(one.shrunk, two.shrunk)


def test_what_is_accepted_holds_the_truth_and_grows_with_the_level(
    problem: Problem, found: Found
) -> None:
    wide, narrow = (accepted(problem, found, 0, level) for level in (0.999, 0.9))
    unseen = Unseen.of(problem.span[0] * problem.op[0])
    for shares in (wide, narrow):
        held = shares.times(float(problem.span[0]))
        ends = unseen.static(held.static), unseen.dynamic(held.dynamic)
        assert ends[0][0] <= STATIC <= ends[0][1]
        assert ends[1][0] <= DYNAMIC <= ends[1][1]
    assert wide.band[0] <= narrow.band[0] <= narrow.band[1] <= wide.band[1]


def test_places_apart_are_the_best_first_and_none_that_is_impossible() -> None:
    places = np.array([[1.0, 0.0], [1.1, 0.0], [3.0, 0.0], [5.0, 0.0]])
    assert best_apart(places, np.array([2.0, 1.0, 3.0, np.inf]), 3, 0.5).tolist() == [1, 2]


def test_a_needle_is_found_that_no_grid_of_the_triangle_meets() -> None:
    clean = Problem.of(pi_loop(STATIC, DYNAMIC, samples=1600, noise=0.002))
    grown = search(clean).best
    assert grown.friction[0] * clean.span[0] == pytest.approx([STATIC, DYNAMIC], abs=0.02)


def test_the_beginning_of_a_record_keeps_its_scale(problem: Problem) -> None:
    part = problem.beginning(150)
    assert part.rows == 150
    assert part.pv[0] == pytest.approx(problem.pv[0, :150])
    assert part.stems(0, np.array([[0.3, 0.1]]), 0.0)[0] == pytest.approx(
        problem.stems(0, np.array([[0.3, 0.1]]), 0.0)[0, :150]
    )
    assert problem.beginning(problem.rows) is problem
