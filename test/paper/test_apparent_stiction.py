"""The ellipse fit is exact on ellipses and says so when there is none."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.paper.programme.apparent_stiction import apparent_stictions, fit_ellipse


@given(
    long=st.floats(0.5, 20.0),
    share=st.floats(0.1, 0.95),
    angle=st.floats(0.0, np.pi),
    centre=st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0)),
)
def test_points_of_an_ellipse_give_it_back(
    long: float, share: float, angle: float, centre: tuple[float, float]
) -> None:
    short = share * long
    turn = np.linspace(0.0, 2.0 * np.pi, 101)[:-1]
    x = centre[0] + long * np.cos(turn) * np.cos(angle) - short * np.sin(turn) * np.sin(angle)
    y = centre[1] + long * np.cos(turn) * np.sin(angle) + short * np.sin(turn) * np.cos(angle)
    found = fit_ellipse(x, y)
    assert found is not None
    assert found.misfit < 1e-5
    chord = 2.0 * long * short / np.hypot(short * np.cos(angle), long * np.sin(angle))
    assert found.chord == pytest.approx(chord, rel=1e-5)


@pytest.mark.parametrize(
    ("x", "y"),
    [
        (np.arange(5.0), np.arange(5.0) ** 2),
        (np.arange(50.0), np.zeros(50)),
        (np.arange(50.0), 2.0 * np.arange(50.0)),
    ],
)
def test_there_need_not_be_an_ellipse(x: np.ndarray, y: np.ndarray) -> None:
    assert fit_ellipse(x, y) is None


def test_apparent_stiction_of_a_cycling_loop_is_near_the_band() -> None:
    (found,) = apparent_stictions(loops.example1(1))
    assert 4.0 < found < 10.0  # f_S + f_D = 7


def test_the_output_that_draws_the_better_ellipse_is_taken() -> None:
    record = loops.example1(1)
    noise = np.random.default_rng(0).standard_normal((len(record), 1))
    both = dataclasses.replace(
        record, outputs=("NOISE", "PV1"), pv=np.hstack([noise, record.pv]), sp=None
    )
    assert apparent_stictions(both).tolist() == apparent_stictions(record).tolist()
