import numpy as np
import pytest

from stiction_ros.control.passage import FREE, REST, Passage

STEM, SP = np.array([50.0]), np.array([7.5, 42.0])


def settled(longest: int = 20) -> Passage:
    """At rest, behind the first samples."""
    passage = Passage(longest)
    for _ in range(REST + 1):
        passage.take_in(np.zeros(2))
        assert not passage.waits(STEM, SP)
    return passage


def fed(passage: Passage, lean: float, samples: int, stem: np.ndarray = STEM) -> list[bool]:
    found = []
    for _ in range(samples):
        passage.take_in(np.array([lean, 0.0]))
        found.append(passage.waits(stem, SP))
    return found


@pytest.mark.parametrize("lean", [1.5, -1.5])
def test_a_stem_at_rest_waits_while_innovations_lean_and_not_for_ever(lean: float) -> None:
    waits = fed(settled(longest=6), lean, 14)
    assert sum(waits) == 6
    first = waits.index(True)
    assert 0 < first <= 4
    assert waits[first : first + 6] == [True] * 6


def test_it_waits_anew_once_innovations_have_been_even() -> None:
    passage = settled(longest=6)
    fed(passage, 1.5, 14)
    assert not any(fed(passage, 0.0, 20)[-5:])
    assert sum(fed(passage, 1.5, 14)) == 6


def test_white_innovations_seldom_make_it_wait() -> None:
    random, passage = np.random.default_rng(3), settled()
    waits = []
    for _ in range(2000):
        passage.take_in(random.normal(size=1))
        waits.append(passage.waits(STEM, SP))
    assert 0 < np.mean(waits) < 0.3


def test_a_stem_that_has_just_jumped_is_free_to_jump_back() -> None:
    passage = settled()
    fed(passage, 1.5, 5)
    away = STEM + 9.0
    assert fed(passage, 1.5, REST, away) == [False] * REST
    assert fed(passage, 1.5, 1, away) == [True]


def test_a_set_point_move_is_answered_at_once() -> None:
    passage = settled()
    assert fed(passage, 1.5, 8)[-1]
    moved = SP + 0.1
    found = []
    for _ in range(FREE + 1):
        passage.take_in(np.array([1.5, 0.0]))
        found.append(passage.waits(STEM, moved))
    assert found == [False] * FREE + [True]


def test_one_wild_innovation_counts_for_four_deviations() -> None:
    """It makes a stem wait for a few samples, not for as long as it allows."""
    passage = settled(longest=100)
    waits = fed(passage, 1e6, 1) + fed(passage, 0.0, 30)
    assert 0 < sum(waits) <= 5


def test_without_a_longest_wait_it_never_waits() -> None:
    assert not any(fed(settled(longest=0), 4.0, 20))
