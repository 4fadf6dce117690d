"""A rounded OP, told finer by the law that moves it."""

import dataclasses

import numpy as np
from gap_loops import loop, record

from stiction_ros.discrepancy.data.controller_check import check_controller, unseen_of
from stiction_ros.discrepancy.data.unrounded import unrounded
from stiction_ros.discrepancy.simulation.free_run import join_records

STEP = 0.2


def test_a_law_tells_op_finer_than_it_was_recorded() -> None:
    own = record(loop())
    coarse = dataclasses.replace(own, op=STEP * np.rint(own.op / STEP))
    runs = join_records(loop(), [coarse])
    check = check_controller(loop(), runs)
    assert np.abs(runs.op - own.op).max() > 0.4 * STEP
    assert np.abs(check.op(runs) - own.op).max() < 0.05 * STEP
    assert unseen_of(runs, check) == ((),)


def test_another_law_tells_nothing() -> None:
    random = np.random.default_rng(1)
    op = 50.0 + np.cumsum(random.standard_normal(500))
    moves = np.diff(op)
    coarse = STEP * np.rint(op / STEP)
    assert unrounded(coarse, -moves, 0.0, STEP, (0.0, 100.0)) is None
    found = unrounded(coarse, moves, 0.0, STEP, (0.0, 100.0))
    assert found is not None
    assert np.abs(found - op).max() < 0.1 * STEP


def test_op_at_a_limit_and_after_it_is_as_recorded() -> None:
    moves = np.tile([0.07, 0.11, -0.05, -0.16], 100)
    op = 99.0 + np.concatenate([[0.0], np.cumsum(moves)])
    op[200:210] = 100.0
    op[210:] = op[210:] - op[210] + 99.13
    found = unrounded(STEP * np.rint(op / STEP), moves, 0.0, STEP, (0.0, 100.0))
    assert found is not None
    assert np.array_equal(found[200:210], op[200:210])
    assert np.abs(found - op).max() <= 0.5 * STEP
