"""ARMAX and ARX equations that are known."""

from __future__ import annotations

import dataclasses

import linear_systems as systems
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.armax import ArmaxFit, fit_armax
from stiction_ros.identification.linear.armax_problem import (
    ArmaxOrders,
    Problem,
    stabilised,
)
from stiction_ros.identification.linear.data import LinearData, LinearStatus, prepare_linear
from stiction_ros.processes import NoiseEntry
from stiction_ros.records.record import Record
from stiction_ros.signals.polynomials import largest_root

A, B, C = (-1.5, 0.7), ((0.05, 0.03), (0.08, -0.02)), (-0.8, 0.3)
ORDERS = ArmaxOrders(2, 2, 2)


def long_record(seed: int, c: tuple[float, ...] = C, samples: int = 6000) -> LinearData:
    random = np.random.default_rng(seed)
    return prepare_linear(systems.armax_record(random, samples, A, B, c, (2, 0), 0.1))


@pytest.mark.parametrize("seed", [0, 1])
def test_armax_recovers_the_noise_polynomial(seed: int) -> None:
    fit = fit_armax(long_record(seed), 0, ORDERS, (2, 0))
    assert fit.status is LinearStatus.OK
    assert fit.c == pytest.approx(C, abs=0.05)
    assert fit.a == pytest.approx(A, abs=0.02)
    assert fit.b.ravel() == pytest.approx(np.ravel(B), abs=0.006)
    assert fit.noise_std == pytest.approx(0.1, rel=0.03)


def test_arx_is_biased_where_armax_is_not() -> None:
    data = long_record(0, c=A)  # white noise on PV
    armax, arx = (fit_armax(data, 0, ArmaxOrders(2, 2, nc), (2, 0)) for nc in (2, 0))
    assert armax.a == pytest.approx(A, abs=0.02)
    assert abs(arx.a[0] - A[0]) > 0.05


def test_the_residual_is_what_the_equation_leaves() -> None:
    data = long_record(3)
    fit = fit_armax(data, 0, ORDERS, (2, 0))
    y = data.y[0] * data.y_scale[0]
    u = data.u * data.u_scale[:, None]
    e = np.zeros(data.samples)
    first = data.samples - fit.count
    for k in range(first, data.samples):
        e[k] = y[k] + fit.a @ y[k - 2 : k][::-1] - fit.constant - fit.c @ e[k - 2 : k][::-1]
        for j, delay in enumerate(fit.delays):
            e[k] -= fit.b[j] @ u[j, k - delay - 2 : k - delay][::-1]
    # The start of C is fitted; it dies out with the roots of C.
    assert e[first + 100 :] == pytest.approx(fit.residual[100:], abs=1e-8)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    order=st.integers(1, 3),
    delay=st.integers(0, 6),
    nc=st.sampled_from([0, 1]),
)
def test_without_noise_the_equation_is_exact(seed: int, order: int, delay: int, nc: int) -> None:
    random = np.random.default_rng(seed)
    a = np.poly(np.linspace(0.3, 0.9, order))[1:]
    b = tuple(random.uniform(0.5, 1.0, order))
    record = systems.armax_record(random, 300, tuple(a), (b,), (), (delay,), 0.0)
    fit = fit_armax(prepare_linear(record), 0, ArmaxOrders(order, order, nc), (delay,))
    assert fit.a == pytest.approx(a, abs=1e-5)
    assert fit.b[0] == pytest.approx(b, abs=1e-5)
    assert fit.fit_free_run > 99.99


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), na=st.integers(1, 3), nc=st.integers(0, 3))
def test_roots_stay_inside_whatever_the_record(seed: int, na: int, nc: int) -> None:
    random = np.random.default_rng(seed)
    op, pv = np.cumsum(random.standard_normal((2, 150, 1)), axis=1)
    data = prepare_linear(Record("walk", 1.0, ("V1",), ("PV1",), op, pv))
    fit = fit_armax(data, 0, ArmaxOrders(na, 1, nc), (0,))
    assert largest_root(np.concatenate([[1.0], fit.a])) < 1.0
    assert largest_root(np.concatenate([[1.0], fit.c])) < 1.0
    assert np.isfinite(fit.fit_free_run)


def test_slope_is_the_derivative() -> None:
    data = long_record(5, samples=400)
    problem = Problem(data.y[0], data.u, (2, 0), ORDERS, 10)
    a, c = np.array([1.0, -1.4, 0.6]), np.array([1.0, -0.5, 0.2])
    point = problem.evaluate(c, a)
    jacobian = problem.slope(point)
    for i in range(4):
        step = np.zeros(4)
        step[i] = 1e-6
        by_a, by_c = (np.concatenate([[0.0], part]) for part in (step[:2], step[2:]))
        moved = problem.evaluate(c + by_c, a + by_a).energy
        back = problem.evaluate(c - by_c, a - by_a).energy
        wanted = 2.0 * jacobian[:, i] @ point.residual
        assert (moved - back) / 2e-6 == pytest.approx(wanted, rel=1e-4, abs=1e-7)


def test_growing_record_gets_the_best_stable_equation() -> None:
    random = np.random.default_rng(4)
    record = systems.armax_record(random, 250, (-1.02,), ((0.1,),), (), (0,), 0.01)
    fit = fit_armax(prepare_linear(record), 0, ArmaxOrders(1, 1, 0), (0,))
    assert fit.status is LinearStatus.CONSTRAINED
    assert fit.reason
    assert 0.98 < abs(fit.poles[0]) < 1.0


def test_stems_of_a_sticky_valve_serve_as_inputs() -> None:
    random = np.random.default_rng(2)
    op = 50.0 + 8.0 * np.sin(np.arange(1500) / 17.0) + 4.0 * np.sin(np.arange(1500) / 41.0)
    stem = HeStiction(4.0, 1.0).simulate(op)
    pv = np.zeros(1500)
    for k in range(1, 1500):
        pv[k] = 0.8 * pv[k - 1] + 0.2 * (stem[k - 1] - 50.0)
    pv += 0.02 * random.standard_normal(1500)
    record = Record("sticky", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None])
    orders = ArmaxOrders(1, 1, 1)
    known = fit_armax(prepare_linear(record, stem[:, None]), 0, orders, (0,))
    unaware = fit_armax(prepare_linear(record), 0, orders, (0,))
    assert known.gain == pytest.approx([1.0], abs=0.01)
    assert known.fit_free_run > unaware.fit_free_run + 10.0


def test_gain_and_theta_belong_together() -> None:
    fit = fit_armax(long_record(0), 0, ORDERS, (2, 0))
    truth = np.sum(B, axis=1) / (1.0 + sum(A))
    assert fit.gain == pytest.approx(truth, rel=0.02)
    assert fit.theta[:2] == pytest.approx(fit.a)
    assert fit.theta[2:6] == pytest.approx(fit.b.ravel())
    assert fit.theta[7:] == pytest.approx(fit.c)


@pytest.mark.parametrize(("c", "entry"), [(A, NoiseEntry.MEASUREMENT), ((0.0, 0.0), "equation")])
def test_the_nearer_place_of_the_noise_is_written(c: tuple[float, ...], entry: str) -> None:
    fit = fit_armax(long_record(1, c), 0, ORDERS, (2, 0))
    assert fit.equation(("V1", "V2")).noise.enters == entry


def test_stabilised_leaves_stable_roots_alone() -> None:
    inside = np.poly([0.5, 0.9])
    assert stabilised(inside) is inside
    assert np.abs(np.roots(stabilised(np.poly([0.5, 1.5])))).max() == pytest.approx(0.98)


def few(samples: int) -> ArmaxFit:
    data = long_record(0, samples=600)
    part = dataclasses.replace(data, u=data.u[:, :samples], y=data.y[:, :samples])
    return fit_armax(part, 0, ORDERS, (2, 0))


def test_short_record_is_refused() -> None:
    assert few(60).count == 56
    with pytest.raises(InputError, match="too few"):
        few(35)


@pytest.mark.parametrize(
    ("orders", "delays", "where"),
    [
        (ArmaxOrders(0, 1, 0), (0, 0), "na"),
        (ArmaxOrders(1, 0, 0), (0, 0), "nb"),
        (ArmaxOrders(1, 1, -1), (0, 0), "nc"),
        (ArmaxOrders(1, 1, 0), (0,), "delay"),
        (ArmaxOrders(1, 1, 0), (0, -1), "delay"),
    ],
)
def test_orders_and_delays_are_checked(
    orders: ArmaxOrders, delays: tuple[int, ...], where: str
) -> None:
    with pytest.raises(InputError) as caught:
        fit_armax(long_record(0, samples=200), 0, orders, delays)
    assert caught.value.where == where
