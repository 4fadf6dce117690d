import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import KanoStiction, SmoothedHeStiction, SmoothedKanoStiction

percent = st.floats(-100.0, 100.0)
bands = st.tuples(st.floats(0.0, 20.0), st.floats(0.0, 20.0))
smoothings = st.floats(0.1, 1e5)
directions = st.floats(-1.0, 1.0)
# S and J lie on odd sixteenths, OP on eighths, the start on a thirty-second: never at a switch
figures = st.tuples(st.integers(0, 160), st.integers(0, 160)).map(
    lambda p: (max(p) / 8.0 + 0.0625, min(p) / 8.0 + 0.0625)
)
exact_signals = st.lists(st.integers(-240, 240).map(lambda n: n / 8.0), min_size=1, max_size=60)


def equations(
    memory: tuple[float, float, float], u: float, band: float, jump: float, tau: float
) -> tuple[float, float]:
    stem, last, d = memory
    f_s, f_d, e = (band + jump) / 2, (band - jump) / 2, u - memory[0]

    def sigma(z: float) -> float:
        return (1.0 + math.tanh(z)) / 2.0

    a = [sigma(tau * (w * d - 0.5)) * sigma(w * tau * (u - last) - 10.0) for w in (1, -1)]
    b = [(1.0 - sum(a)) * sigma(tau * (w * e - f_s)) for w in (1, -1)]
    up, down = a[0] + b[0], a[1] + b[1]
    return (1.0 - up - down) * stem + up * (u - f_d) + down * (u + f_d), up - down


@given(bands, smoothings, percent, percent, directions, percent)
def test_step_is_the_equations(
    pair: tuple[float, float], tau: float, stem: float, last: float, d: float, op: float
) -> None:
    memory, out = SmoothedKanoStiction(*pair, tau).step((stem, last, d), op)
    expected = equations((stem, last, d), op, *pair, tau)
    assert memory == pytest.approx((expected[0], op, expected[1]), abs=1e-9)
    assert out == memory[0]


@given(figures, exact_signals)
def test_at_the_default_tau_it_is_kano_away_from_the_switches(
    pair: tuple[float, float], op: list[float]
) -> None:
    hard = KanoStiction(*pair).simulate(np.array(op), 0.03125)
    smooth = SmoothedKanoStiction(*pair).simulate(np.array(op), 0.03125)
    assert smooth == pytest.approx(hard, abs=1e-6)


def test_at_the_default_tau_the_signature_is_that_of_kano() -> None:
    # where the sine turns OP moves by less than 20/τ, which the smoothed form takes for rest
    op = 50.0 + 12.0 * np.sin(np.arange(400) / 17.0)
    op[100:120] = op[100]
    hard = KanoStiction(7.0, 3.0).simulate(op)
    assert np.abs(SmoothedKanoStiction(7.0, 3.0).simulate(op) - hard).max() < 20.0 / 1e4


def test_the_distance_to_kano_falls_as_tau_grows() -> None:
    op = 50.0 + 12.0 * np.sin(np.arange(400) / 17.0)
    hard = KanoStiction(7.0, 3.0).simulate(op)
    misses = [
        np.sqrt(np.mean((SmoothedKanoStiction(7.0, 3.0, tau).simulate(op) - hard) ** 2))
        for tau in (10.0, 100.0, 1e3, 1e4, 1e5)
    ]
    assert all(later < sooner for sooner, later in itertools.pairwise(misses))


@given(bands.filter(lambda p: p[1] <= p[0]), smoothings, percent, percent)
def test_at_rest_its_first_step_is_that_of_smoothed_he(
    pair: tuple[float, float], tau: float, stem: float, op: float
) -> None:
    law = SmoothedKanoStiction(*pair, max(tau, 50.0))
    he = SmoothedHeStiction(law.static_friction, law.dynamic_friction, law.smoothing)
    assert law.step(law.rest(stem), op)[1] == pytest.approx(he.step(stem, op)[1], abs=1e-8)


@given(bands, smoothings, percent, percent, directions, percent)
def test_the_stem_stays_among_its_three_modes(
    pair: tuple[float, float], tau: float, stem: float, last: float, d: float, op: float
) -> None:
    law = SmoothedKanoStiction(*pair, tau)
    modes = (stem, op - law.dynamic_friction, op + law.dynamic_friction)
    after = law.step((stem, last, d), op)[1]
    assert min(modes) - 1e-9 <= after <= max(modes) + 1e-9
