"""What lies between samples, and what it leaves open of a friction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.identification.evidence.unseen import BETWEEN, LATE, Unseen, innovation

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
