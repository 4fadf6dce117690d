import numpy as np
import pytest

from stiction_ros.control.observer import InnovationGate


def gate(outputs: int = 1) -> InnovationGate:
    return InnovationGate(np.full(outputs, 0.1), 20.0, 3)


def test_one_wild_innovation_is_held_back() -> None:
    it = gate()
    assert it.pass_on(np.array([1e6])).tolist() == [0.0]
    assert it.closed.tolist() == [True]
    assert it.pass_on(np.array([0.1])).tolist() == [0.1]
    assert it.closed.tolist() == [False]


def test_a_lasting_change_passes_after_three_in_growing_portions() -> None:
    it = gate()
    passed = [float(it.pass_on(np.array([50.0]))[0]) for _ in range(6)]
    assert passed == pytest.approx([0.0, 0.0, 0.0, 2.0, 4.0, 6.0])


def test_a_small_lasting_change_passes_whole_after_three() -> None:
    it = gate()
    passed = [float(it.pass_on(np.array([-2.5]))[0]) for _ in range(5)]
    assert passed == pytest.approx([0.0, 0.0, 0.0, -2.0, -2.5])


def test_values_just_within_the_gate_hardly_widen_it() -> None:
    it = gate()
    for _ in range(10):
        it.pass_on(np.array([1.9]))
    assert it.pass_on(np.array([3.0])).tolist() == [0.0]


def test_wild_ones_with_a_calm_one_between_do_not_add_up() -> None:
    it = gate()
    for _ in range(5):
        assert it.pass_on(np.array([50.0])).tolist() == [0.0]
        assert it.pass_on(np.array([50.0])).tolist() == [0.0]
        it.pass_on(np.array([0.0]))


def test_the_outputs_are_judged_each_for_itself() -> None:
    assert gate(2).pass_on(np.array([50.0, 0.2])).tolist() == [0.0, 0.2]


@pytest.mark.parametrize("factor", [5.0, 15.0, 60.0])
def test_noise_that_was_given_too_small_passes_in_the_end(factor: float) -> None:
    it, noise = gate(), np.random.default_rng(1).normal(size=2000) * factor * 0.1
    held = [bool(it.pass_on(np.array([v]))[0] == 0.0) for v in noise]
    assert np.mean(held[1000:]) < 0.01


def test_what_lasts_does_not_open_the_gate_for_what_comes_later() -> None:
    it = gate()
    for _ in range(50):
        it.pass_on(np.array([1e6]))
    it.pass_on(np.array([0.0]))
    assert it.pass_on(np.array([50.0])).tolist() == [0.0]
