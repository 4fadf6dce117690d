import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from stiction_ros.errors import InputError
from stiction_ros.processes import StirredTank, TankParameters

NONE = np.zeros(5)
QUIET = np.zeros(2)
valve = st.floats(0.0, 100.0)


def tank(**options: object) -> StirredTank:
    return StirredTank(("V1", "V2"), **options)  # type: ignore[arg-type]


def equation_a1(state: np.ndarray, stem: np.ndarray) -> list[float]:
    """(A.1) with the figures of Table A.3, written out, per minute."""
    c, t = state
    f_a, f_b, w = stem[0] / 100.0, 0.5, 60.0 * stem[1] / 100.0
    dc = (f_a * 10.0 + f_b * 5.0 - (f_a + f_b) * c) / 10.0
    heat = w * 2272.0 / (1100.0 * 4.180)
    dt = (f_a * 25.0 + f_b * 30.0 - (f_a + f_b) * t + heat) / 10.0
    return [dc, dt]


def test_the_tank_rests_at_the_nominal_point() -> None:
    assert tank().steady_state(np.array([50.0, 50.0])) == pytest.approx([7.5, 42.324], abs=5e-4)


@given(valve, valve)
def test_a_steady_state_does_not_move(first: float, second: float) -> None:
    stem = np.array([first, second])
    rest = tank().steady_state(stem)
    assert equation_a1(rest, stem) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert tank().advance(rest, stem, NONE, QUIET) == pytest.approx(rest, abs=1e-9)


@given(valve, valve, st.floats(5.0, 10.0), st.floats(20.0, 80.0))
def test_a_sample_is_the_solution_of_a1(first: float, second: float, c: float, t: float) -> None:
    stem, start = np.array([first, second]), np.array([c, t])
    exact = solve_ivp(
        lambda _, x: equation_a1(x, stem), (0.0, 1.0), start, rtol=1e-12, atol=1e-12
    ).y[:, -1]
    assert tank().advance(start, stem, NONE, QUIET) == pytest.approx(exact, abs=1e-4)


def test_equation_noise_adds_to_the_state() -> None:
    stem, state, noise = np.array([40.0, 60.0]), np.array([7.0, 40.0]), np.array([0.1, -0.3])
    quiet = tank().advance(state, stem, NONE, QUIET)
    assert tank().advance(state, stem, NONE, noise) == pytest.approx(quiet + noise)


@pytest.mark.parametrize(
    ("point", "pole", "gain"),
    [
        (50.0, 0.9048, [[0.0250, 0.0], [-0.1732, 0.2965]]),
        (40.0, 0.9139, [[0.0309, 0.0], [-0.1773, 0.3294]]),
    ],
)
def test_slopes_of_the_tank_are_those_of_facts(
    point: float, pole: float, gain: list[list[float]]
) -> None:
    model, stem, h = tank(), np.array([point, point]), 1e-4
    rest = model.steady_state(stem)
    a = np.array(
        [
            (
                model.advance(rest + d, stem, NONE, QUIET)
                - model.advance(rest - d, stem, NONE, QUIET)
            )
            / (2 * h)
            for d in h * np.eye(2)
        ]
    ).T
    k = np.array(
        [
            (model.steady_state(stem + d) - model.steady_state(stem - d)) / (2 * h)
            for d in h * np.eye(2)
        ]
    ).T
    assert np.linalg.eigvals(a) == pytest.approx([pole, pole], abs=5e-5)
    assert k == pytest.approx(np.array(gain), abs=6e-5)


def test_the_linear_model_is_the_tank_about_the_nominal_point() -> None:
    model = tank().linear(60.0)
    assert np.linalg.eigvals(model.a) == pytest.approx([0.9048, 0.9048], abs=5e-5)
    assert model.gain == pytest.approx(np.array([[0.0250, 0.0], [-0.1732, 0.2965]]), abs=5e-5)
    assert model.pv0 == pytest.approx([7.5, 42.324], abs=5e-4)


def test_the_linear_model_predicts_small_moves_of_stems_and_disturbances() -> None:
    plant = tank(measured_disturbances=("T_A", "F_B"))
    model = plant.linear(60.0)
    move, upset = np.array([0.05, -0.03]), np.array([0.0, 0.0, 0.1, 0.0, 0.002])
    after = plant.advance(model.pv0, model.stem0 + move, upset, QUIET)
    predicted = model.pv0 + model.b @ move + model.e @ upset[[2, 4]]
    assert after == pytest.approx(predicted, abs=1e-5)


@pytest.mark.parametrize(("index", "rises"), [(0, (1, 0)), (1, (1, 0)), (2, (0, 1)), (3, (0, 1))])
def test_richer_or_warmer_feeds_raise_their_output_only(index: int, rises: tuple[int, int]) -> None:
    stem = np.array([50.0, 50.0])
    rest, upset = tank().steady_state(stem), np.zeros(5)
    upset[index] = 1.0
    moved = tank().advance(rest, stem, upset, QUIET) - rest
    assert (moved > 1e-3).tolist() == [bool(r) for r in rises]


def test_wrong_counts_and_names_are_refused() -> None:
    with pytest.raises(InputError):
        StirredTank(("V1",))
    with pytest.raises(InputError):
        StirredTank(("V1", "V2"), ("C",))
    with pytest.raises(InputError) as caught:
        tank(measured_disturbances=("F_A",))
    assert (caught.value.where, bool(caught.value.fix)) == ("measured_disturbances", True)


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_parameters_must_be_positive(bad: float) -> None:
    with pytest.raises(InputError) as caught:
        TankParameters(volume=bad)
    assert caught.value.where == "volume"
