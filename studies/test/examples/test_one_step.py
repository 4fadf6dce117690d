"""The one-step criterion (14) for given stems."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import OutputModel
from stiction_ros.records import Record
from stiction_studies.examples.one_step import one_step_estimate, square_error

SAMPLES = 200


def model(orders: tuple[int, int], delay: int) -> OutputModel:
    a, b = (0.0,) * orders[0], {"V1": (0.0,) * orders[1]}
    return OutputModel("PV1", a, b, {"V1": delay}, 0.0, 0.0, 0.0, 0.0)


def record(seed: int, noise: float, delay: int = 2) -> Record:
    """y = 0.7 y₋₁ + 0.4 χ_{−1−delay} + 5, with white noise in the equation."""
    random = np.random.default_rng(seed)
    chi = np.repeat(random.normal(50.0, 5.0, SAMPLES // 5), 5)
    y = np.full(SAMPLES, 80.0)
    for k in range(1 + delay, SAMPLES):
        y[k] = 0.7 * y[k - 1] + 0.4 * chi[k - 1 - delay] + 5.0 + noise * random.normal()
    return Record("made", 1.0, ("V1",), ("PV1",), chi[:, None], y[:, None])


def plain(entry: Record, orders: tuple[int, int], delay: int) -> FloatArray:
    """Return the residuals of the same regression, row by row."""
    y, chi = entry.pv[:, 0], entry.op[:, 0]
    first = max(orders[0], orders[1] + delay)
    rows = [
        [y[k - i] for i in range(1, orders[0] + 1)]
        + [chi[k - i - delay] for i in range(1, orders[1] + 1)]
        + [1.0]
        for k in range(first, SAMPLES)
    ]
    theta = np.linalg.lstsq(np.array(rows), y[first:], rcond=None)[0]
    return np.asarray(y[first:] - np.array(rows) @ theta)


@given(
    seed=st.integers(0, 10_000),
    orders=st.tuples(st.integers(1, 3), st.integers(1, 3)),
    delay=st.integers(0, 6),
)
def test_it_is_the_plain_regression(seed: int, orders: tuple[int, int], delay: int) -> None:
    entry = record(seed, 0.3)
    residual = plain(entry, orders, delay)
    found = square_error(entry, entry.op, [model(orders, delay)])
    assert found == pytest.approx(float(residual @ residual), rel=1e-9)


@given(shift=st.floats(-1e3, 1e3), scale=st.floats(0.1, 10.0))
def test_an_offset_costs_nothing_and_a_scale_its_square(shift: float, scale: float) -> None:
    entry = record(1, 0.3)
    other = Record("made", 1.0, ("V1",), ("PV1",), entry.op, shift + scale * entry.pv)
    before, after = (square_error(r, r.op, [model((2, 2), 2)]) for r in (entry, other))
    assert after == pytest.approx(scale**2 * before, rel=1e-6)


def test_the_true_stem_without_noise_leaves_nothing() -> None:
    entry = record(2, 0.0)
    assert square_error(entry, entry.op, [model((1, 1), 2)]) < 1e-15
    assert square_error(entry, entry.op, [model((1, 1), 3)]) > 1.0


def test_the_first_samples_are_measured_ones() -> None:
    entry = record(3, 0.3)
    estimate = one_step_estimate(entry, entry.op, model((2, 3), 4))
    assert np.array_equal(estimate[:7], entry.pv[:7, 0])
    assert not np.any(estimate[7:] == entry.pv[7:, 0])
