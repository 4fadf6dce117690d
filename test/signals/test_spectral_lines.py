"""Sines and cosines at a period and at its harmonics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.signals.spectral_lines import (
    fitted_lines,
    taken_by_lines,
    taken_by_waves,
    waves_of,
)

COUNT, LENGTH = 300, 1024


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return an orthonormal basis and what it leaves of a signal."""
    random = np.random.default_rng(seed)
    plain = np.linalg.qr(random.standard_normal((COUNT, 3)))[0]
    values = random.standard_normal(COUNT)
    return plain, values - plain @ (plain.T @ values)


def energy(columns: np.ndarray, plain: np.ndarray, left: np.ndarray) -> float:
    whole = np.column_stack([plain, columns])
    return float(left @ left - np.linalg.lstsq(whole, left, rcond=None)[1][0])


@given(st.integers(0, 1000), st.integers(20, 480))
def test_a_line_takes_what_least_squares_does(seed: int, line: int) -> None:
    plain, left = drawn(seed)
    columns = waves_of(2.0 * np.pi * line / LENGTH * np.arange(COUNT), 1)
    wanted = energy(columns, plain, left)
    assert taken_by_lines(left, plain, LENGTH)[line] == pytest.approx(wanted, rel=1e-6)


@given(st.integers(0, 1000), st.floats(0.02, 0.15))
def test_harmonics_take_one_after_the_other(seed: int, frequency: float) -> None:
    plain, left = drawn(seed)
    angle = 2.0 * np.pi * frequency * np.arange(COUNT)
    taken = np.cumsum(taken_by_waves(angle, 3, plain, left))[1::2]
    wanted = [energy(waves_of(angle, h), plain, left) for h in (1, 2, 3)]
    assert taken == pytest.approx(wanted, rel=1e-8)


def test_a_wave_that_is_explained_takes_nothing() -> None:
    angle = 0.3 * np.arange(COUNT)
    plain = np.linalg.qr(waves_of(angle, 1))[0]
    left = np.random.default_rng(3).standard_normal(COUNT)
    assert taken_by_waves(angle, 1, plain, left - plain @ (plain.T @ left)).tolist() == [0.0, 0.0]


def test_lines_are_found_with_their_sizes() -> None:
    angle = 2.0 * np.pi / 25.0 * np.arange(COUNT)
    values = 5.0 + 2.0 * np.cos(angle) - 3.0 * np.sin(2.0 * angle)
    found, total = fitted_lines(values, 25.0, 2)
    assert found == pytest.approx([5.0, 2.0, 0.0, 0.0, -3.0], abs=1e-9)
    assert total == pytest.approx(values)
