"""State-space models of systems that are known."""

import dataclasses

import linear_systems as systems
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import LinearStatus, OrderCriterion
from stiction_ros.identification.linear.fit import LinearOptions, fit_linear
from stiction_ros.identification.linear.result import LinearIdentification
from stiction_ros.records.record import Record
from stiction_ros.signals.subspace_projection import SubspaceMethod

OBLIQUE = [SubspaceMethod.N4SID, SubspaceMethod.CVA]


def markov(fit: LinearIdentification, count: int) -> np.ndarray:
    return systems.System(fit.a, fit.b, fit.c).markov(count)


def fitted(record: Record, **options: object) -> LinearIdentification:
    return fit_linear(record, LinearOptions(**options))  # type: ignore[arg-type]


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    order=st.integers(1, 4),
    valves=st.integers(1, 2),
    outputs=st.integers(1, 2),
    method=st.sampled_from(OBLIQUE),
)
def test_without_noise_the_markov_parameters_are_recovered(
    seed: int, order: int, valves: int, outputs: int, method: SubspaceMethod
) -> None:
    random = np.random.default_rng(seed)
    system = systems.random_system(random, order, valves, outputs)
    record = systems.experiment(system, random, 500)
    fit = fitted(record, order=order, method=method)
    truth = system.markov(20)
    assert fit.status is LinearStatus.OK
    assert np.abs(markov(fit, 20) - truth).max() < 1e-5 * np.abs(truth).max()
    assert fit.fit_free_run.min() > 99.99


@pytest.mark.parametrize("method", list(SubspaceMethod))
def test_with_noise_the_markov_parameters_are_near(method: SubspaceMethod) -> None:
    random = np.random.default_rng(7)
    system = systems.random_system(random, 3, 2, 2)
    record = systems.experiment(system, random, 3000, noise=0.3)
    fit = fitted(record, order=3, method=method)
    truth = system.markov(30)
    assert np.linalg.norm(markov(fit, 30) - truth) < 0.06 * np.linalg.norm(truth)


@pytest.mark.parametrize("method", list(SubspaceMethod))
def test_noise_on_pv_leaves_its_own_size(method: SubspaceMethod) -> None:
    random = np.random.default_rng(3)
    system = systems.random_system(random, 2, 1, 1)
    fit = fitted(systems.experiment(system, random, 3000, noise=0.2), order=2, method=method)
    assert fit.noise_std[0] == pytest.approx(0.2, rel=0.08)


def test_offset_and_initial_state_belong_to_the_model() -> None:
    random = np.random.default_rng(5)
    system = systems.random_system(random, 2, 1, 1)
    record = systems.experiment(system, random, 400)
    fit = fitted(record, order=2)
    run = systems.System(fit.a, fit.b, fit.c).run(record.op - fit.stem0, fit.x0) + fit.pv0
    assert run == pytest.approx(record.pv, abs=1e-4)


@pytest.mark.trial
@pytest.mark.parametrize("criterion", list(OrderCriterion))
def test_order_is_found(criterion: OrderCriterion) -> None:
    random = np.random.default_rng(11)
    system = systems.random_system(random, 3, 1, 1)
    record = systems.experiment(system, random, 3000, noise=0.1)
    fit = fitted(record, criterion=criterion)
    assert [rival.order for rival in fit.rivals] == list(range(1, 9))
    assert fit.order == 3


def noisy_closed_loop(seed: int) -> tuple[Record, np.ndarray]:
    """A first-order process with slow equation noise, fed back; OP is excited."""
    random = np.random.default_rng(seed)
    samples = 4000
    extra = systems.random_binary(random, samples, 1, 0.1, (-2.0, 2.0))[:, 0]
    shock = 0.5 * random.standard_normal(samples)
    op, pv, state, upset = np.zeros(samples), np.zeros(samples), 0.0, 0.0
    for k in range(samples):
        upset = 0.9 * upset + shock[k]
        pv[k] = state + upset
        op[k] = -2.0 * pv[k] + extra[k]
        state = 0.8 * state + 0.2 * op[k]
    record = Record("closed", 1.0, ("V1",), ("PV1",), op[:, None] + 50.0, pv[:, None])
    return record, 0.2 * 0.8 ** np.arange(20)


def closed_loop_error(method: SubspaceMethod) -> float:
    record, truth = noisy_closed_loop(2)
    found = markov(fitted(record, order=2, method=method), 20)[:, 0, 0]
    return float(np.linalg.norm(found - truth) / np.linalg.norm(truth))


def test_predictor_is_right_in_closed_loop() -> None:
    assert closed_loop_error(SubspaceMethod.PREDICTOR) < 0.12


def test_oblique_projection_is_wrong_in_closed_loop() -> None:
    # Why the documentation asks for the predictor: the same record misleads the others.
    assert closed_loop_error(SubspaceMethod.CVA) > 0.3


def test_one_step_fit_uses_the_kalman_gain() -> None:
    record, _ = noisy_closed_loop(3)
    fit = fitted(record, order=2, method=SubspaceMethod.PREDICTOR)
    assert fit.noise_std[0] == pytest.approx(0.5, rel=0.06)
    assert fit.fit_one_step[0] > fit.fit_free_run[0] + 5.0


def test_delays_become_states() -> None:
    random = np.random.default_rng(8)
    system = systems.random_system(random, 2, 2, 1)
    record = systems.experiment(system, random, 600)
    late = np.vstack([np.full((3, 1), 50.0), record.op[:-3, :1]])
    record = dataclasses.replace(record, op=np.hstack([record.op[:, :1], record.op[:, 1:]]))
    moved = systems.System(system.a, system.b, system.c).run(
        np.hstack([late, record.op[:, 1:]]) - 50.0, np.zeros(2)
    )
    record = dataclasses.replace(record, pv=moved + 20.0)
    fit = fitted(record, order=2, delay=(0, 4))
    model = fit.linear_model
    found = systems.System(model.a, model.b, model.c).markov(15)
    truth = system.markov(15)
    assert model.order == 5
    assert found[:, :, 1] == pytest.approx(truth[:, :, 1], abs=1e-6)
    assert found[3:, :, 0] == pytest.approx(truth[:-3, :, 0], abs=1e-6)
    assert np.abs(found[:3, :, 0]).max() < 1e-12
    assert fit.gain == pytest.approx(
        system.c @ np.linalg.solve(np.eye(2) - system.a, system.b), abs=1e-6
    )


def test_growing_record_is_reported_unstable() -> None:
    samples = 300
    random = np.random.default_rng(4)
    op = systems.random_binary(random, samples, 1, 0.2, (45.0, 55.0))
    system = systems.System(np.array([[1.03]]), np.array([[0.1]]), np.ones((1, 1)))
    pv = system.run(op - 50.0, np.ones(1)) + 0.01 * random.standard_normal((samples, 1))
    fit = fitted(Record("growing", 1.0, ("V1",), ("PV1",), op, pv), order=1)
    assert fit.status is LinearStatus.UNSTABLE
    assert abs(fit.poles[0]) == pytest.approx(1.03, abs=1e-3)
    assert fit.reason


@pytest.mark.trial
def test_stable_order_that_loses_to_an_unstable_one_is_doubtful() -> None:
    # OP is a function of PV but for rounding: the record tells no process from the controller.
    random = np.random.default_rng(1)
    op, pv, state, upset = np.zeros(1200), np.zeros(1200), 0.0, 0.0
    for k in range(1200):
        upset = 0.97 * upset + 0.1 * random.standard_normal()
        pv[k] = state + upset
        before = (op[k - 1], pv[k - 1]) if k else (0.0, 0.0)
        op[k] = before[0] - 1.5 * (pv[k] - before[1] + pv[k] / 20.0)
        state = 0.8 * state + 0.2 * op[k]
    noise = 1e-4 * random.standard_normal((2, 1200, 1))
    record = Record("PI", 1.0, ("V1",), ("PV1",), op[:, None] + noise[0], pv[:, None] + noise[1])
    fit = fitted(record, method=SubspaceMethod.PREDICTOR)
    rivals = {rival.bic: rival.model.radius for rival in fit.rivals}
    unstable = [bic for bic, radius in rivals.items() if radius >= 1.0]
    assert fit.status is LinearStatus.CONSTRAINED
    assert "unstable" in fit.reason
    assert np.abs(fit.poles).max() < 1.0
    assert min(unstable) < min(bic for bic, radius in rivals.items() if radius < 1.0) - 20.0


def test_more_states_than_the_record_shows_are_refused() -> None:
    random = np.random.default_rng(6)
    record = systems.experiment(systems.random_system(random, 1, 1, 1), random, 500)
    with pytest.raises(InputError, match="shows 1 states, not 4; take a lower order"):
        fitted(record, order=4)


def test_order_that_the_record_is_too_short_for_is_refused() -> None:
    random = np.random.default_rng(6)
    record = systems.experiment(systems.random_system(random, 1, 1, 1), random, 120)
    with pytest.raises(InputError, match="too few for a horizon of 61"):
        fitted(record, order=60)


def test_results_are_read_only_and_repeatable() -> None:
    random = np.random.default_rng(9)
    record = systems.experiment(systems.random_system(random, 2, 1, 1), random, 400, noise=0.1)
    first, second = fitted(record), fitted(record)
    assert np.array_equal(first.a, second.a)
    with pytest.raises(ValueError):
        first.a[0, 0] = 0.0
