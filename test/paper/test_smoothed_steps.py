"""The smoothed forms of He's law and of Kano's: their equations, and how near they are."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction, KanoStiction
from stiction_ros.paper.smoothed_laws import kano_step, smooth_law, smoothed_step

percent = st.floats(-100.0, 100.0)
frictions = st.tuples(st.floats(0.0, 20.0), st.floats(0.0, 1.0)).map(lambda p: (p[0], p[0] * p[1]))
smoothings = st.floats(0.1, 1e5)
directions = st.floats(-1.0, 1.0)


def he(friction: tuple[float, float], tau: float, stem: float, op: float) -> float:
    return float(smoothed_step(stem, op, friction, tau, math.tanh))


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
    assert he(friction, tau, stem, op) == pytest.approx(expected, abs=1e-11)


@given(frictions, percent, percent)
def test_the_distance_to_he_falls_as_tau_grows(
    friction: tuple[float, float], stem: float, op: float
) -> None:
    from_the_edge = abs(abs(op - stem) - friction[0])
    assume(from_the_edge > 0.01)
    hard = HeStiction(*friction).step(stem, op)[1]
    misses = [  # from where on the edge of the band is sharp at this OP
        abs(he(friction, tau / from_the_edge, stem, op) - hard) for tau in (10.0, 20.0, 40.0, 100.0)
    ]
    assert all(later <= sooner + 1e-9 for sooner, later in itertools.pairwise(misses))
    assert misses[-1] < 1e-9


def equations_of_kano(
    memory: tuple[float, float, float], u: float, f_s: float, f_d: float, tau: float
) -> tuple[float, float]:
    stem, last, d = memory
    e = u - stem

    def sigma(z: float) -> float:
        return (1.0 + math.tanh(z)) / 2.0

    a = [sigma(tau * (w * d - 0.5)) * sigma(w * tau * (u - last) - 10.0) for w in (1, -1)]
    b = [(1.0 - sum(a)) * sigma(tau * (w * e - f_s)) for w in (1, -1)]
    up, down = a[0] + b[0], a[1] + b[1]
    return (1.0 - up - down) * stem + up * (u - f_d) + down * (u + f_d), up - down


@given(frictions, smoothings, percent, percent, directions, percent)
def test_a_step_of_kano_is_its_equations_and_stays_among_its_three_modes(
    friction: tuple[float, float], tau: float, stem: float, last: float, d: float, op: float
) -> None:
    found = kano_step((stem, last, d), op, (*friction, tau), math.tanh)
    assert found == pytest.approx(equations_of_kano((stem, last, d), op, *friction, tau), abs=1e-9)
    modes = (stem, op - friction[1], op + friction[1])
    assert min(modes) - 1e-9 <= found[0] <= max(modes) + 1e-9


@given(frictions, smoothings, percent, percent)
def test_at_rest_the_first_step_of_kano_is_that_of_he(
    friction: tuple[float, float], tau: float, stem: float, op: float
) -> None:
    figures = (*friction, max(tau, 50.0))
    stem_after, _ = kano_step((stem, stem, 0.0), op, figures, math.tanh)
    assert stem_after == pytest.approx(he(friction, figures[2], stem, op), abs=1e-8)


def test_the_distance_to_kano_falls_as_tau_grows() -> None:
    op = 50.0 + 12.0 * np.sin(np.arange(400) / 17.0)
    hard = KanoStiction(7.0, 3.0).simulate(op)
    stems = [
        smooth_law("kano").stems(op[:, None], np.array([[5.0, 2.0]]), np.array([tau]))[0]
        for tau in (10.0, 100.0, 1e3, 1e4, 1e5)
    ]
    misses = [np.sqrt(np.mean((stem - hard) ** 2)) for stem in stems]
    assert all(later < sooner for sooner, later in itertools.pairwise(misses))
    assert np.abs(stems[3] - hard).max() < 20.0 / 1e4
