"""Valves by mechanics behave as what the catalogue calls stiction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.blind.friction_physics import KarnoppValve, LuGreValve
from stiction_ros.effects import HeStiction
from stiction_ros.effects.friction_parameters import FrictionPair

every_physics = pytest.mark.parametrize("kind", [KarnoppValve, LuGreValve])
frictions = st.tuples(st.floats(0.5, 8.0), st.floats(0.1, 0.7)).map(lambda p: (p[0], p[0] * p[1]))


def test_karnopp_slips_and_stands_as_he_s_law() -> None:
    op = 50.0 + 12.0 * np.sin(np.arange(300) / 15.0)
    stem, expected = KarnoppValve(5.0, 2.0).simulate(op), HeStiction(5.0, 2.0).simulate(op)
    assert np.abs(stem - expected).mean() < 0.2 * np.abs(op - expected).mean()


@every_physics
@settings(max_examples=20)
@given(frictions, st.floats(0.0, 0.9))
def test_a_push_below_static_friction_hardly_moves_the_stem(
    kind: type[FrictionPair], friction: tuple[float, float], share: float
) -> None:
    push = share * friction[1]  # below the dynamic friction even a sliding stem would stop
    stem = kind(*friction).simulate(np.full(20, 50.0 + push), 50.0)
    assert np.abs(stem - 50.0).max() < 0.1 * friction[0]


@every_physics
@settings(max_examples=20)
@given(frictions, st.sampled_from([-1.0, 1.0]))
def test_a_large_move_ends_within_the_band(
    kind: type[FrictionPair], friction: tuple[float, float], sign: float
) -> None:
    op = 50.0 + sign * 4.0 * friction[0]
    stem = kind(*friction).simulate(np.full(20, op), 50.0)
    assert abs(stem[-1] - op) <= friction[0] + 0.1
    assert np.all(np.isfinite(stem))


@every_physics
def test_a_ramp_moves_the_stem_in_jumps(kind: type[FrictionPair]) -> None:
    op = 50.0 + 0.2 * np.arange(150)
    moves = np.abs(np.diff(kind(5.0, 1.0).simulate(op)))
    assert np.quantile(moves, 0.6) < 0.1
    assert moves.max() > 1.0
