"""Where what a record does not reject ends, and what lies between its samples."""

import numpy as np
import pytest
from evidence_loops import pi_loop
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.deferred import chi2_quantile
from stiction_ros.identification.evidence.accepted import (
    BETWEEN,
    FREEDOM,
    LATE,
    MISFIT,
    OUTWARDS,
    Unseen,
    _beyond,
    _looked_at,
    accepted,
    innovation,
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
    slack = chi2_quantile(0.95, FREEDOM) + MISFIT * held.gain
    assert held.band[0] < nodes[lost <= lost.min() + slack].min()


SHARES = st.floats(0.0, 1.0)


def test_each_figure_is_wider_by_its_ends() -> None:
    unseen = Unseen(less=0.2, more=0.6)
    assert unseen.band((5.0, 6.0)) == pytest.approx((4.6, 7.2))
    assert unseen.static((3.0, 4.0)) == pytest.approx((2.8, 5.2))
    assert unseen.dynamic((1.0, 2.0)) == pytest.approx((0.2, 2.6))


@given(static=SHARES, share=SHARES, less=SHARES, more=SHARES, late=SHARES, far=SHARES, jump=SHARES)
def test_the_figures_of_a_valve_whose_ends_lie_elsewhere_are_possible(
    static: float, share: float, less: float, more: float, late: float, far: float, jump: float
) -> None:
    """Both ends of the band earlier or farther out, those of the jump farther out alone."""
    dynamic, unseen = share * static, Unseen(less, more)
    moved = 2.0 * (far * more - late * less)
    band, slip = static + dynamic + moved, static - dynamic + 2.0 * jump * more
    true = max(0.5 * (band + slip), 0.0), max(0.5 * (band - slip), 0.0), max(band, 0.0)
    ends = unseen.static, unseen.dynamic, unseen.band
    for figure, seen, possible in zip(true, (static, dynamic, static + dynamic), ends, strict=True):
        low, high = possible((seen, seen))
        assert low - 1e-9 <= figure <= high + 1e-9


def test_an_op_that_its_past_tells_hides_no_peaks_and_moves_all_the_same() -> None:
    random = np.random.default_rng(3)
    noise = random.standard_normal(4000)
    unseen = Unseen.of(50.0 + noise)
    assert unseen.more == pytest.approx(BETWEEN, rel=0.05)
    assert unseen.less == pytest.approx(LATE * 2.0 / np.sqrt(np.pi), rel=0.05)
    told = Unseen.of(50.0 + np.sin(0.1 * np.arange(4000.0)))
    assert told.more < 1e-3
    assert told.less == pytest.approx(LATE * 0.1 * 2.0 / np.pi, rel=0.02)
    assert innovation(2.0 * noise) == pytest.approx(2.0 * innovation(noise))
