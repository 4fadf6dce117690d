"""Rounded values: each tells only in which step of the lattice it lies."""

import numpy as np
import pytest
from gap_loops import loop, record
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.discrepancy import GapOptions, find_discrepancy
from stiction_ros.discrepancy.likelihood.noise import Blocks, given_noise, grouped
from stiction_ros.effects import Quantisation

COUNT = 1500
BLOCKS = Blocks(np.arange(COUNT) >= 6, np.zeros(COUNT, dtype=bool))


def minus_two_log(values: np.ndarray, quantum: float) -> float:
    fit = given_noise(values, np.zeros((COUNT, 0)), BLOCKS, np.zeros(0))
    return grouped(fit, quantum, BLOCKS).minus_two_log


def test_a_fine_lattice_is_the_density() -> None:
    values = np.random.default_rng(1).standard_normal(COUNT)
    plain = given_noise(values, np.zeros((COUNT, 0)), BLOCKS, np.zeros(0)).minus_two_log
    assert minus_two_log(values, 0.01) == pytest.approx(plain, rel=1e-3)


@given(st.floats(0.0, 1.0))
@settings(max_examples=20)
def test_nothing_is_gained_inside_a_step(share: float) -> None:
    inside = 0.45 * np.sin(np.arange(COUNT))  # within half a quantum
    assert minus_two_log(share * inside, 1.0) == pytest.approx(minus_two_log(inside, 1.0), abs=60.0)
    assert minus_two_log(inside, 1.0) < 0.2 * minus_two_log(inside + 0.5 * np.sign(inside), 1.0)


@pytest.mark.trial
@pytest.mark.parametrize("seed", [1, 2, 3, 5])
def test_rounding_makes_no_friction(seed: int) -> None:
    model = loop(0.05)
    recorded = record(model.with_effect("sensor:PV1", Quantisation(0.4)), seed=seed)
    answer = find_discrepancy(model, [recorded], GapOptions(quick=True))
    assert [(e.place, e.effect) for e in answer.effects] == [("sensor:PV1", "quantisation")]
