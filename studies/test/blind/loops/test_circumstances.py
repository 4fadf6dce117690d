"""Noise and set-points are what the regime says."""

import dataclasses

import numpy as np
import pytest

from stiction_ros.loop import simulate_open_loop
from stiction_studies.blind.loops.base_loops import KINDS, BaseLoop, base_loop
from stiction_studies.blind.loops.circumstances import (
    KICK,
    REACH,
    drawn_noise,
    drawn_regime,
    drawn_set_points,
    with_noise,
)
from stiction_studies.blind.loops.truth import Regime

MOVES = Regime("second", "normal", "moves", "ar1", False)
every_kind = pytest.mark.parametrize("kind", KINDS)


def loop(kind: str = "second", seed: int = 3) -> BaseLoop:
    return base_loop(np.random.default_rng([seed, 9]), kind, tight=False)


def test_without_set_point_moves_a_load_keeps_the_loop_busy() -> None:
    random = np.random.default_rng(1)
    drawn = [drawn_regime(random) for _ in range(200)]
    assert {r.noise for r in drawn if r.excitation != "moves"} == {"ar1", "equation"}
    assert {r.noise for r in drawn if r.excitation == "moves"} == {"measurement", "ar1", "equation"}


@every_kind
@pytest.mark.parametrize("excitation", ["none", "noise"])
def test_without_excitation_the_set_point_rests(kind: str, excitation: str) -> None:
    regime = dataclasses.replace(MOVES, excitation=excitation)
    schedule = drawn_set_points(np.random.default_rng(1), loop(kind), regime, 1000)
    assert len(schedule.times) == 1


@every_kind
def test_a_set_point_asks_no_more_than_op_can_give(kind: str) -> None:
    base = loop(kind)
    schedule = drawn_set_points(np.random.default_rng(1), base, MOVES, 1000)
    moves = np.abs(np.diff(schedule.values, axis=0))
    gains = np.array([abs(tuning.gain) for tuning in base.tunings])
    assert len(moves) >= 4
    assert np.all(moves * gains <= KICK + 1e-9)
    assert np.all(np.abs(schedule.values - base.model.pv_start) <= REACH * base.gains + 1e-9)


@pytest.mark.parametrize("noise", ["measurement", "ar1", "equation"])
def test_noise_has_the_size_that_was_drawn(noise: str) -> None:
    base = loop("first")
    regime = dataclasses.replace(MOVES, noise=noise)
    sizes = drawn_noise(np.random.default_rng(2), base, regime)
    model = with_noise(base.model, sizes, noise)
    pv = simulate_open_loop(model, np.full((6000, 1), 50.0), seed=1).record.pv[500:]
    white, load = float(sizes.white[0]), float(sizes.loads[0])
    wanted = {"measurement": white, "ar1": np.hypot(white, load), "equation": load}[noise]
    assert pv.std() == pytest.approx(wanted, rel=0.25)
