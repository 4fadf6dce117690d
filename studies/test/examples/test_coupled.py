"""The coupled loop of one to three valves."""

import numpy as np
import pytest

from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.processes import ArxProcess
from stiction_studies.examples import coupled_loop

COUNTS = (1, 2, 3)


@pytest.mark.parametrize("valves", COUNTS)
def test_stems_follow_the_stated_friction(valves: int) -> None:
    example = coupled_loop(3, valves, samples=400)
    assert example.record.stem is not None
    for j, tag in enumerate(example.record.valves):
        f_s, f_d = example.friction(tag)
        op = example.record.op[:, j]
        wanted = op if f_s == 0.0 else HeStiction(f_s, f_d).simulate(op, 50.0)
        np.testing.assert_allclose(example.record.stem[:, j], wanted, atol=1e-9)


@pytest.mark.parametrize("valves", COUNTS)
def test_a_sticky_valve_moves_often_enough_to_be_seen(valves: int) -> None:
    example = coupled_loop(3, valves)
    assert example.record.stem is not None
    moves = np.count_nonzero(np.diff(example.record.stem, axis=0), axis=0)
    assert moves.min() >= 12


def test_every_valve_moves_every_output() -> None:
    process = coupled_loop(3, 3, samples=50).truth.process
    assert isinstance(process, ArxProcess)
    for equation in process.equations:
        assert all(abs(sum(b)) > 0.0 for b in equation.b.values())


def test_the_loop_is_the_same_for_the_same_seed() -> None:
    first, second, other = (coupled_loop(seed, 2, samples=200).record for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.pv, second.pv)
    assert np.any(first.pv != other.pv)


@pytest.mark.parametrize("valves", [0, 4])
def test_other_numbers_of_valves_are_refused(valves: int) -> None:
    with pytest.raises(InputError, match="outside 1 to 3"):
        coupled_loop(3, valves)
