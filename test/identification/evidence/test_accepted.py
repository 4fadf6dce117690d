"""Where what a record does not reject ends."""

import numpy as np
import pytest
from evidence_loops import pi_loop

from stiction_ros.identification.evidence.accepted import (
    OUTWARDS,
    _beyond,
    _looked_at,
    _slack,
    accepted,
)
from stiction_ros.identification.evidence.candidate import Judge
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.search import search


def test_past_both_ends_the_band_goes_on_in_even_steps() -> None:
    rows = _beyond(np.array([[0.2, 0.1, 0.05], [0.3, 0.2, 0.0], [0.4, 0.05, -0.1]]))
    band = rows[:, :2].sum(axis=1)
    steps = np.concatenate([0.3 * (1.0 - OUTWARDS), 0.5 * (1.0 + OUTWARDS)])
    assert np.unique(band.round(9)) == pytest.approx(np.sort(steps))
    assert np.all((rows[:, 1] >= 0.0) & (rows[:, 1] <= rows[:, 0]))
    assert set(rows[:, 2]) == {0.05, 0.0}


def test_a_jump_without_a_band_to_lose_stays_a_friction() -> None:
    rows = _beyond(np.array([[0.2, 0.0, 0.0]]))
    assert np.all((rows[:, 1] >= 0.0) & (rows[:, 1] <= rows[:, 0]))


def test_a_band_ends_between_the_nodes_of_the_grids() -> None:
    problem = Problem.of(pi_loop(3.0, 1.0, samples=400, noise=0.4, seed=2))
    found = search(problem)
    held = accepted(problem, found, 0, 0.95)
    judge = Judge.of(problem, found.best, 0, found.best.fits, held=True)
    rows, lost = _looked_at(judge, found)
    nodes = rows[:, :2].sum(axis=1)
    assert np.abs(nodes - held.band[0]).min() > 1e-3
    assert held.band[0] < nodes[lost <= lost.min() + _slack(held.gain, 0.95)].min()
