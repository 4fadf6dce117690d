"""ARX equations that are known, orders and delays that are chosen, the table of their rivals."""

import dataclasses

import linear_systems as systems
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearStatus,
    OrderCriterion,
    prepare_linear,
)
from stiction_ros.identification.linear.orders import (
    EquationFit,
    EquationOrders,
    OrderOptions,
    choose_orders,
    fit_equation,
)
from stiction_ros.records.record import Record
from stiction_ros.signals.polynomials import largest_root

A, B = (-1.5, 0.7), ((0.05, 0.03), (0.08, -0.02))
ORDERS = EquationOrders(2, 2)


def long_record(seed: int, samples: int = 6000) -> LinearData:
    random = np.random.default_rng(seed)
    return prepare_linear(systems.armax_record(random, samples, A, B, (), (2, 0), 0.1))


@pytest.mark.parametrize("seed", [0, 1])
def test_the_equation_is_found(seed: int) -> None:
    fit = fit_equation(long_record(seed), 0, ORDERS, (2, 0))
    assert fit.status is LinearStatus.OK
    assert fit.a == pytest.approx(A, abs=0.02)
    assert fit.b.ravel() == pytest.approx(np.ravel(B), abs=0.006)
    assert fit.noise_std == pytest.approx(0.1, rel=0.03)
    assert fit.gain == pytest.approx(np.sum(B, axis=1) / (1.0 + sum(A)), rel=0.05)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), order=st.integers(1, 3), delay=st.integers(0, 6))
def test_without_noise_the_equation_is_exact(seed: int, order: int, delay: int) -> None:
    random = np.random.default_rng(seed)
    a = np.poly(np.linspace(0.3, 0.9, order))[1:]
    b = tuple(random.uniform(0.5, 1.0, order))
    record = systems.armax_record(random, 300, tuple(a), (b,), (), (delay,), 0.0)
    fit = fit_equation(prepare_linear(record), 0, EquationOrders(order, order), (delay,))
    assert fit.a == pytest.approx(a, abs=1e-5)
    assert fit.b[0] == pytest.approx(b, abs=1e-5)
    assert fit.fit_free_run > 99.99


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), na=st.integers(1, 3))
def test_roots_stay_inside_whatever_the_record(seed: int, na: int) -> None:
    random = np.random.default_rng(seed)
    op, pv = np.cumsum(random.standard_normal((2, 150, 1)), axis=1)
    data = prepare_linear(Record("walk", 1.0, ("V1",), ("PV1",), op, pv))
    fit = fit_equation(data, 0, EquationOrders(na, 1), (0,))
    assert largest_root(np.concatenate([[1.0], fit.a])) < 1.0
    assert np.isfinite(fit.fit_free_run)


def test_growing_record_gets_a_stable_equation() -> None:
    random = np.random.default_rng(4)
    record = systems.armax_record(random, 250, (-1.02,), ((0.1,),), (), (0,), 0.01)
    fit = fit_equation(prepare_linear(record), 0, EquationOrders(1, 1), (0,))
    assert fit.status is LinearStatus.CONSTRAINED
    assert fit.reason
    assert 0.98 < abs(fit.poles[0]) < 1.0


def test_stems_of_a_sticky_valve_serve_as_inputs() -> None:
    random = np.random.default_rng(2)
    op = 50.0 + 8.0 * np.sin(np.arange(1500) / 17.0) + 4.0 * np.sin(np.arange(1500) / 41.0)
    stem = HeStiction(4.0, 1.0).simulate(op)
    pv = np.zeros(1500)
    for k in range(1, 1500):
        pv[k] = 0.8 * pv[k - 1] + 0.2 * (stem[k - 1] - 50.0) + 0.02 * random.standard_normal()
    record = Record("sticky", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None])
    known = fit_equation(prepare_linear(record, stem[:, None]), 0, EquationOrders(1, 1), (0,))
    unaware = fit_equation(prepare_linear(record), 0, EquationOrders(1, 1), (0,))
    assert known.gain == pytest.approx([1.0], abs=0.01)
    assert known.fit_free_run > unaware.fit_free_run + 10.0


def few(samples: int) -> EquationFit:
    data = long_record(0, samples=600)
    part = dataclasses.replace(data, u=data.u[:, :samples], y=data.y[:, :samples])
    return fit_equation(part, 0, ORDERS, (2, 0))


def test_short_record_is_refused() -> None:
    assert few(60).count == 56
    with pytest.raises(InputError, match="too few"):
        few(34)


@pytest.mark.parametrize(
    ("orders", "delays", "where"),
    [
        (EquationOrders(0, 1), (0, 0), "na"),
        (EquationOrders(1, 0), (0, 0), "nb"),
        (EquationOrders(1, 1), (0,), "delay"),
        (EquationOrders(1, 1), (0, -1), "delay"),
    ],
)
def test_orders_and_delays_are_checked(
    orders: EquationOrders, delays: tuple[int, ...], where: str
) -> None:
    with pytest.raises(InputError) as caught:
        fit_equation(long_record(0, samples=200), 0, orders, delays)
    assert caught.value.where == where


@pytest.fixture(scope="module")
def coloured() -> LinearData:
    random = np.random.default_rng(1)
    return prepare_linear(systems.armax_record(random, 2000, A, B[:1], (-0.8,), (4,), 0.05))


@pytest.mark.parametrize("criterion", list(OrderCriterion))
def test_delay_is_found(coloured: LinearData, criterion: OrderCriterion) -> None:
    choice = choose_orders(coloured, 0, OrderOptions(delay=(0, 6), criterion=criterion))
    assert choice.fit.delays == (4,)


def test_every_rival_is_in_the_table(coloured: LinearData) -> None:
    options = OrderOptions((1, 2), (1, 3), delay=(2, 5))
    choice = choose_orders(coloured, 0, options)
    tried = {(row.orders.output, row.orders.input) for row in choice.rivals}
    assert tried == {(1, 1), (1, 3), (2, 1), (2, 3)}
    assert len({(row.orders, row.delays) for row in choice.rivals}) == len(choice.rivals)
    assert [row is choice.fit for row in choice.rivals].count(True) == 1
    assert len(choice.best_of_each_order()) == 4


def test_rivals_are_scored_on_the_same_samples(coloured: LinearData) -> None:
    choice = choose_orders(coloured, 0, OrderOptions(delay=(0, 6)))
    simple = choose_orders(coloured, 0, OrderOptions(output=(3,), delay=(0, 6)))
    assert choice.fit.count == simple.fit.count == coloured.samples - 9


def test_two_valves_have_delays_of_their_own() -> None:
    random = np.random.default_rng(2)
    b = ((0.05, 0.03), (0.04, 0.02))
    record = systems.armax_record(random, 2000, A, b, (), (5, 1), 0.05)
    choice = choose_orders(prepare_linear(record), 0, OrderOptions(output=(2,)))
    assert choice.fit.delays == (5, 1)


@pytest.mark.parametrize("wrong", [{"output": ()}, {"delay": (3, 1)}, {"delay": (-1, 1)}])
def test_options_are_checked(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError):
        OrderOptions(**wrong)  # type: ignore[arg-type]
