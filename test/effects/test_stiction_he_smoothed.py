import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction, SmoothedHeStiction

percent = st.floats(-100.0, 100.0)
frictions = st.tuples(st.floats(0.0, 20.0), st.floats(0.0, 1.0)).map(lambda p: (p[0], p[0] * p[1]))
smoothings = st.floats(0.1, 1e5)


def equations_5_and_6(u: float, stem: float, f_s: float, f_d: float, tau: float) -> float:
    e = u - stem
    eta_1 = 0.5 * math.tanh(tau * (e + f_s)) + 0.5 * math.tanh(tau * (-e + f_s))
    eta_2 = 0.5 * math.tanh(-tau * (e + f_s)) + 0.5 * math.tanh(tau * (-e + f_s))
    return eta_1 * stem + (1.0 - eta_1) * u + eta_2 * f_d


@given(frictions, smoothings, percent, percent)
def test_step_is_equations_5_and_6(
    friction: tuple[float, float], tau: float, stem: float, op: float
) -> None:
    expected = equations_5_and_6(op, stem, *friction, tau)
    assert SmoothedHeStiction(*friction, tau).step(stem, op)[1] == pytest.approx(
        expected, abs=1e-11
    )


@given(frictions, percent, percent)
def test_the_distance_to_he_falls_as_tau_grows(
    friction: tuple[float, float], stem: float, op: float
) -> None:
    from_the_edge = abs(abs(op - stem) - friction[0])
    assume(from_the_edge > 0.01)
    hard = HeStiction(*friction).step(stem, op)[1]
    misses = [  # from where on the edge of the band is sharp at this OP
        abs(SmoothedHeStiction(*friction, tau / from_the_edge).step(stem, op)[1] - hard)
        for tau in (10.0, 20.0, 40.0, 100.0)
    ]
    assert all(later <= sooner + 1e-9 for sooner, later in itertools.pairwise(misses))
    assert misses[-1] < 1e-9


def test_at_the_default_tau_the_signature_is_that_of_he() -> None:
    op = 50.0 + 12.0 * np.sin(np.arange(400) / 17.0)
    smooth = SmoothedHeStiction(5.0, 2.0).simulate(op)
    assert np.abs(smooth - HeStiction(5.0, 2.0).simulate(op)).max() < 1e-9
