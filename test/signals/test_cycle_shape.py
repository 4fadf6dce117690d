"""The shape of OP's movement: known for a sine, a triangle, a square and noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.cycle_shape import CycleShape

TURNS = np.arange(2400) / 96.0


def triangle() -> FloatArray:
    return np.asarray(2.0 * np.abs(2.0 * (TURNS % 1.0) - 1.0) - 1.0)


@pytest.mark.parametrize(
    ("values", "kurtosis"),
    [
        pytest.param(np.sin(2.0 * np.pi * TURNS), 1.5, id="sine"),
        pytest.param(triangle(), 1.8, id="triangle"),
        pytest.param(np.sign(np.sin(2.0 * np.pi * (TURNS + 0.001))), 1.0, id="square"),
    ],
)
def test_a_regular_cycle(values: FloatArray, kurtosis: float) -> None:
    shape = CycleShape.of(values)
    assert shape.half_cycles < 0.1
    assert shape.kurtosis == pytest.approx(kurtosis, abs=0.2)


def test_noise_has_half_cycles_of_any_length() -> None:
    white = np.random.default_rng(1).standard_normal(6000)
    shape = CycleShape.of(lfilter([1.0], [1.0, -0.8], white))
    assert shape.half_cycles > 0.3
    assert shape.kurtosis == pytest.approx(3.0, abs=0.5)


@given(scale=st.floats(1e-3, 1e3), level=st.floats(-1e3, 1e3), noise=st.floats(0.0, 0.1))
def test_neither_unit_nor_level_plays_a_part(scale: float, level: float, noise: float) -> None:
    values = triangle() + noise * np.random.default_rng(0).standard_normal(len(TURNS))
    shape, moved = CycleShape.of(values), CycleShape.of(scale * values + level * scale)
    assert moved.kurtosis == pytest.approx(shape.kurtosis, rel=1e-4)
    assert moved.half_cycles == pytest.approx(shape.half_cycles, abs=1e-4)


@pytest.mark.parametrize("values", [np.zeros(100), np.arange(2.0)])
def test_what_does_not_move_has_no_cycle(values: FloatArray) -> None:
    assert CycleShape.of(values) == CycleShape(1.0, 3.0)
