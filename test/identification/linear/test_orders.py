"""Orders and delays that are chosen, and the table of their rivals."""

import linear_systems as systems
import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import LinearData, OrderCriterion, prepare_linear
from stiction_ros.identification.linear.orders import OrderOptions, choose_orders

A, B = (-1.5, 0.7), ((0.05, 0.03),)


@pytest.fixture(scope="module")
def coloured() -> LinearData:
    random = np.random.default_rng(1)
    return prepare_linear(systems.armax_record(random, 2000, A, B, (-0.8,), (4,), 0.05))


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
