"""Stems kept as moves are those of the law, sample by sample."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples import dense

from stiction_ros.effects import HeStiction, KanoStiction
from stiction_ros.identification.friction.grid import simulate
from stiction_ros.identification.switching.step_signals import StepSignals, stem_steps

SIZES = st.integers(0, 3)
GRID = np.array([[0.0, 0.0], [0.3, 0.1], [1.0, 1.0], [2.5, 0.5], [90.0, 1.0]])


@given(seed=st.integers(0, 10_000), samples=st.integers(1, 130), start=st.floats(-3.0, 3.0))
@pytest.mark.parametrize("law", [HeStiction, KanoStiction])
def test_moves_give_the_stem_of_the_law(
    law: type[HeStiction] | type[KanoStiction], seed: int, samples: int, start: float
) -> None:
    u = np.random.default_rng(seed).standard_normal(samples).cumsum()
    steps = stem_steps(law, GRID, u, start)
    stems = simulate(law, GRID, u, start)
    assert (dense(steps, 0) == stems).all()
    assert (steps.moves == np.count_nonzero(np.diff(stems, axis=0), axis=0)).all()


@given(seed=st.integers(0, 10_000), samples=st.integers(1, 40), size=st.integers(0, 3))
def test_dense_signals_come_back(seed: int, samples: int, size: int) -> None:
    generator = np.random.default_rng(seed)
    one, two = generator.integers(0, 2, (2, samples, size)).astype(float)
    steps = StepSignals.of(one, two)
    assert (steps.size, steps.count) == (size, samples)
    assert (dense(steps, 0) == one).all()
    assert (dense(steps, 1) == two).all()
    assert (steps.moves == np.count_nonzero(np.diff(one, axis=0), axis=0)).all()


@given(seed=st.integers(0, 10_000), samples=st.integers(1, 40), sizes=st.tuples(*3 * [SIZES]))
def test_joined_signals_are_those_of_the_parts(
    seed: int, samples: int, sizes: tuple[int, ...]
) -> None:
    generator = np.random.default_rng(seed)
    parts = [generator.integers(0, 2, (samples, size)).astype(float) for size in sizes]
    joined = StepSignals.joined([StepSignals.of(part) for part in parts])
    assert (dense(joined, 0) == np.hstack(parts)).all()


@given(seed=st.integers(0, 10_000), samples=st.integers(1, 40), chosen=st.lists(st.integers(0, 4)))
def test_chosen_signals_are_those_asked_for(seed: int, samples: int, chosen: list[int]) -> None:
    every = np.random.default_rng(seed).integers(0, 2, (samples, 5)).astype(float)
    steps = StepSignals.of(every, 2.0 * every).chosen(np.array(chosen, dtype=np.int64))
    assert (dense(steps, 0) == every[:, chosen]).all()
    assert (dense(steps, 1) == 2.0 * every[:, chosen]).all()
