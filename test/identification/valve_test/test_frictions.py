"""The cells of frictions: their prior, and the moves of the stem under each."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from manual_tests import path

from stiction_ros.effects import HeStiction
from stiction_ros.identification.valve_test.frictions import KEPT, LARGEST, SMALLEST, Frictions
from stiction_ros.identification.valve_test.steps import Steps

STEPS = Steps.of(path())


def test_the_prior_is_one_and_half_of_it_is_without_a_jump() -> None:
    cells = Frictions.all(STEPS)
    prior = np.exp(cells.logs)
    assert np.isclose(prior.sum(), 1.0)
    assert np.isclose(prior[cells.even].sum(), 0.5)
    assert cells.static.min() > SMALLEST
    assert cells.static.max() < LARGEST


@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1))
def test_refining_keeps_the_prior_of_the_likely_cells(seed: int) -> None:
    cells = Frictions.all(STEPS)
    shares = np.random.default_rng(seed).random(len(cells.logs))
    finer = cells.refined(STEPS, shares)
    likely = np.sort(np.argsort(shares)[-KEPT:])
    assert np.exp(finer.logs).sum() >= np.exp(cells.logs[likely]).sum() - 1e-12
    assert np.exp(finer.logs).sum() <= 1.0 + 1e-9
    assert finer.widths[:, 0].min() == 0.5 * cells.widths[:, 0].min()


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_a_cell_moves_its_stem_by_hes_law(seed: int) -> None:
    cells = Frictions.all(STEPS)
    random = np.random.default_rng(seed)
    i = int(random.choice(np.flatnonzero(~cells.lags & (cells.dynamic >= 0.0))))
    law = HeStiction(cells.static[i], min(cells.dynamic[i], cells.static[i]))
    begin = STEPS.levels[0] + cells.middles[i, 2] * cells.static[i]
    stems = law.simulate(STEPS.levels[1:], start=begin)
    moves = cells.moves[cells.which[i]]
    np.testing.assert_allclose(moves, np.diff([begin, *stems]), atol=1e-8)
    np.testing.assert_allclose(cells.ends[i], STEPS.levels[-1] - stems[-1], atol=1e-8)
