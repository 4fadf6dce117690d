"""Orders and delays that are chosen, and the table of their rivals."""

from __future__ import annotations

import linear_systems as systems
import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearKind,
    OrderCriterion,
    prepare_linear,
)
from stiction_ros.identification.linear.orders import JudgedError, OrderOptions, choose_orders

A, B = (-1.5, 0.7), ((0.05, 0.03),)


@pytest.fixture(scope="module")
def coloured() -> LinearData:
    random = np.random.default_rng(1)
    return prepare_linear(systems.armax_record(random, 2000, A, B, (-0.8,), (4,), 0.05))


@pytest.mark.parametrize("criterion", list(OrderCriterion))
def test_armax_finds_orders_and_delay(coloured: LinearData, criterion: OrderCriterion) -> None:
    options = OrderOptions(LinearKind.ARMAX, (1, 2, 3), noise=1, delay=(0, 6), criterion=criterion)
    choice = choose_orders(coloured, 0, options)
    assert (choice.fit.orders.output, choice.fit.orders.input) == (2, 2)
    assert choice.fit.delays == (4,)


def test_every_rival_is_in_the_table(coloured: LinearData) -> None:
    options = OrderOptions(LinearKind.ARX, (1, 2), (1, 3), delay=(2, 5))
    choice = choose_orders(coloured, 0, options)
    tried = {(row.orders.output, row.orders.input) for row in choice.rows}
    assert tried == {(1, 1), (1, 3), (2, 1), (2, 3)}
    assert len({(row.orders, row.delays) for row in choice.rows}) == len(choice.rows)
    assert [row.chosen for row in choice.rows].count(True) == 1
    assert all(row.orders.noise == 0 for row in choice.rows)
    assert len(choice.best_of_each_order()) == 4


def test_rivals_are_scored_on_the_same_samples(coloured: LinearData) -> None:
    choice = choose_orders(coloured, 0, OrderOptions(delay=(0, 6)))
    simple = choose_orders(coloured, 0, OrderOptions(output=(3,), delay=(0, 6)))
    assert choice.fit.count == simple.fit.count == coloured.samples - 9


def test_free_run_judges_arx_and_one_step_armax(coloured: LinearData) -> None:
    for kind, judged in ((LinearKind.ARX, "free_run"), (LinearKind.ARMAX, "one_step")):
        options = OrderOptions(kind, (1,), delay=(4, 4))
        assert choose_orders(coloured, 0, options).judged == judged


def test_delay_of_example_1_with_noise_on_pv() -> None:
    # By its one-step error ARX takes a delay of 6, as the paper's grid search did.
    record = loops.example1(1)
    data = prepare_linear(record, record.stem)
    one_step = OrderOptions(output=(3,), judged=JudgedError.ONE_STEP)
    assert choose_orders(data, 0, one_step).fit.delays == (6,)
    armax = OrderOptions(LinearKind.ARMAX, (3,), delay=(3, 7))
    assert choose_orders(data, 0, armax).fit.delays == (5,)


def test_the_best_one_step_rival_is_reported_beside() -> None:
    record = loops.example1(1)
    choice = choose_orders(prepare_linear(record, record.stem), 0, OrderOptions(output=(3,)))
    assert min(choice.rows, key=lambda row: row.bic).delays == (6,)


def test_two_valves_have_delays_of_their_own() -> None:
    random = np.random.default_rng(2)
    b = ((0.05, 0.03), (0.04, 0.02))
    record = systems.armax_record(random, 2000, A, b, (), (5, 1), 0.05)
    choice = choose_orders(prepare_linear(record), 0, OrderOptions(output=(2,)))
    assert choice.fit.delays == (5, 1)


@pytest.mark.parametrize(
    "wrong",
    [{"kind": LinearKind.STATE_SPACE}, {"output": ()}, {"delay": (3, 1)}, {"delay": (-1, 1)}],
)
def test_options_are_checked(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError):
        OrderOptions(**wrong)  # type: ignore[arg-type]
