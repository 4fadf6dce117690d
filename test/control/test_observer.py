import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from loops import first_order, kalman, luenberger, models, stable_model

from stiction_ros.control.observer import Observer, ObserverKind, ObserverTuning
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

either = pytest.mark.parametrize("tuning", [kalman, luenberger])
NO_DV = np.zeros(0)


def slowest(model: LinearModel, observer: Observer) -> float:
    """Spectral radius of the error dynamics."""
    n, p = model.order, len(model.pv0)
    a = np.eye(n + p)
    a[:n, :n] = model.a
    c = np.hstack([model.c, np.eye(p)])
    return float(np.abs(np.linalg.eigvals(a @ (np.eye(n + p) - observer.gain @ c))).max())


@either
@given(model=models(), seed=st.integers(0, 1000))
def test_a_constant_output_disturbance_is_estimated_exactly(
    tuning: Callable[[int], ObserverTuning], model: LinearModel, seed: int
) -> None:
    random = np.random.default_rng(seed)
    p, m = len(model.pv0), len(model.stem0)
    observer = Observer(model, tuning(p))
    x, d = random.normal(size=model.order), random.normal(size=p)
    samples = int(np.log(1e-10) / np.log(slowest(model, observer)))
    assume(samples < 3000)
    for _ in range(samples):
        stem = model.stem0 + random.normal(size=m)
        observer.correct(model.c @ x + model.pv0 + d)
        observer.predict(stem, NO_DV)
        x = model.a @ x + model.b @ (stem - model.stem0) + model.constant
    shown = model.c @ observer.state + observer.disturbance
    assert shown == pytest.approx(model.c @ x + d, abs=1e-5)
    assert observer.disturbance == pytest.approx(d, abs=1e-4)


@either
def test_a_wrong_gain_leaves_no_error_at_rest(tuning: Callable[[int], ObserverTuning]) -> None:
    model, plant = first_order(gain=0.5), first_order(gain=0.7)
    observer, x, stem = Observer(model, tuning(1)), np.zeros(1), np.array([60.0])
    for _ in range(1000):
        observer.correct(plant.c @ x + plant.pv0)
        observer.predict(stem, NO_DV)
        x = plant.a @ x + plant.b @ (stem - plant.stem0)
    assert model.c @ observer.state + model.pv0 + observer.disturbance == pytest.approx(
        plant.c @ x + plant.pv0, abs=1e-9
    )


@either
@given(model=models())
def test_the_error_dynamics_are_stable(
    tuning: Callable[[int], ObserverTuning], model: LinearModel
) -> None:
    assert slowest(model, Observer(model, tuning(len(model.pv0)))) < 1.0


def test_rest_shows_the_measurement() -> None:
    model = stable_model(1, 3, 2, 2)
    observer, pv = Observer(model, kalman(2)), np.array([4.0, -2.0])
    observer.rest(np.array([40.0, 60.0]), pv)
    observer.correct(pv)
    assert observer.innovation == pytest.approx([0.0, 0.0], abs=1e-12)
    before = observer.state.copy()
    observer.predict(np.array([40.0, 60.0]), NO_DV)
    assert observer.state == pytest.approx(before, abs=1e-9)


def test_measured_disturbances_move_the_prediction() -> None:
    model = dataclasses.replace(first_order(), e=np.array([[0.3]]))
    observer = Observer(model, kalman(1))
    observer.predict(model.stem0, np.array([2.0]))
    assert observer.state == pytest.approx([0.6])


def test_the_luenberger_observer_corrects_the_disturbance_only() -> None:
    observer = Observer(first_order(), luenberger(1, gain=0.25))
    observer.correct(np.array([24.0]))
    assert (observer.state.tolist(), observer.disturbance.tolist()) == ([0.0], [1.0])


@either
def test_an_integrating_process_is_refused(tuning: Callable[[int], ObserverTuning]) -> None:
    integrating = dataclasses.replace(first_order(), a=np.eye(1))
    with pytest.raises(InputError) as caught:
        Observer(integrating, tuning(1))
    assert "output disturbance" in caught.value.what
    assert caught.value.fix


@pytest.mark.parametrize(
    ("state_noise", "disturbance_noise", "measurement_noise"),
    [(1.0, 1e-5, np.inf), (1.0, np.inf, 1e-4), (1e300, 1e-5, 1e-4), (1.0, 1e300, 1e-4)],
)
def test_variances_without_a_filter_are_refused(
    state_noise: float, disturbance_noise: float, measurement_noise: float
) -> None:
    tuning = ObserverTuning(
        ObserverKind.KALMAN,
        state_noise,
        np.array([disturbance_noise]),
        np.array([measurement_noise]),
    )
    with pytest.raises(InputError, match="no Kalman filter for these variances"):
        Observer(first_order(), tuning)


def test_an_unstable_process_takes_kalman_but_not_luenberger() -> None:
    unstable = dataclasses.replace(first_order(), a=np.array([[1.05]]))
    Observer(unstable, kalman(1))
    with pytest.raises(InputError, match="stable"):
        Observer(unstable, luenberger(1))


def test_an_unstable_mode_that_no_output_shows_is_refused() -> None:
    hidden = LinearModel(
        np.diag([0.5, 1.2]),
        np.ones((2, 1)),
        np.array([[1.0, 0.0]]),
        np.zeros((2, 0)),
        np.zeros(2),
        np.zeros(1),
        np.zeros(1),
    )
    with pytest.raises(InputError):
        Observer(hidden, kalman(1))


def test_an_innovation_that_is_held_back_is_no_good_fit() -> None:
    observer = Observer(first_order(), dataclasses.replace(kalman(1), gate=20.0, gate_samples=3))
    misfits = []
    for pv in (20.0, 1e3, 1e6):
        observer.rest(np.array([50.0]), np.array([20.0]))
        observer.correct(np.array([pv]))
        misfits.append(observer.misfit)
    assert observer.innovation.tolist() == [0.0]
    assert misfits == pytest.approx([0.0, 400.0, 400.0])  # the same for whoever meets the outlier
