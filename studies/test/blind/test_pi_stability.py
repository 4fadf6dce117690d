import numpy as np
import pytest

from stiction_ros.processes import LinearModel
from stiction_studies.blind.pi_stability import closed_loop_radius, largest_gains


def lag(pole: float = 0.9, gain: float = 2.0, copies: int = 1) -> LinearModel:
    eye = np.eye(copies)
    return LinearModel(
        pole * eye,
        gain * (1.0 - pole) * eye,
        eye,
        np.zeros((copies, 0)),
        np.zeros(copies),
        np.zeros(copies),
        np.zeros(copies),
    )


def simulated_decay(linear: LinearModel, gain: float, integral_time: float) -> float:
    """The factor by which a PI loop's error shrinks per sample, late after a step in SP."""
    xi, integral, errors = np.zeros(1), 0.0, []
    for _ in range(400):
        error = 1.0 - float(linear.c[0] @ xi)
        integral += error / integral_time
        errors.append(abs(error))
        xi = linear.a @ xi + linear.b[:, 0] * gain * (error + integral)
    return float((max(errors[180:240]) / max(errors[80:140])) ** 0.01)


def test_the_radius_is_how_fast_the_loop_settles() -> None:
    found = closed_loop_radius(lag(), np.array([0.5]), np.array([20.0]))
    assert found == pytest.approx(simulated_decay(lag(), 0.5, 20.0), abs=2e-3)


def test_without_a_gain_the_integral_alone_remains() -> None:
    assert closed_loop_radius(lag(), np.array([0.0]), np.array([8.0])) == pytest.approx(1.0)


@pytest.mark.parametrize("radius", [1.0, 0.98])
def test_the_largest_gain_brings_the_poles_to_the_circle(radius: float) -> None:
    times = np.array([8.0])
    gains = largest_gains(lag(), times, radius, np.array([0.1]))
    assert closed_loop_radius(lag(), gains, times) == pytest.approx(radius, abs=1e-6)
    assert closed_loop_radius(lag(), 1.01 * gains, times) > radius


def test_loops_side_by_side_do_not_change_each_other() -> None:
    gains, times = np.array([0.3, 0.1]), np.array([8.0, 5.0])
    parts = [closed_loop_radius(lag(), gains[i : i + 1], times[i : i + 1]) for i in range(2)]
    assert closed_loop_radius(lag(copies=2), gains, times) == pytest.approx(max(parts))
