"""Testable is what the workflow's own criterion could see."""

import dataclasses
import math

import pytest

from stiction_studies.blind.loops.generator import blind_loop
from stiction_studies.blind.testable import gains_beyond_margin

SINE, STICTION = 19, 7  # seeds of single loops
STICTION_OF_ONE = 11  # in a loop of one valve
NOTHING_MOVES = 210  # a seed with a curved valve that rests in one place


@pytest.mark.trial
def test_an_effect_that_shows_is_testable() -> None:
    for seed in (SINE, STICTION):
        seen, truth = blind_loop(seed)
        (gain,) = gains_beyond_margin(seen, truth).values()
        assert 20.0 < gain < math.inf


def test_an_effect_that_nothing_excites_is_not() -> None:
    seen, truth = blind_loop(NOTHING_MOVES)
    assert truth.cause == "valve characteristic"
    (gain,) = gains_beyond_margin(seen, truth).values()
    assert gain < 0.0


def test_an_effect_that_is_not_there_is_not() -> None:
    seen, _ = blind_loop(29)
    _, other = blind_loop(STICTION_OF_ONE)
    assert other.cause == "valve stiction"
    (gain,) = gains_beyond_margin(seen, other).values()
    assert gain < 0.0


def test_of_two_the_other_one_is_known() -> None:
    seen, truth = blind_loop(200, "two")
    both = gains_beyond_margin(seen, truth)
    assert set(both) == truth.names
    alone = dataclasses.replace(truth, hidden=truth.hidden[:1])
    (unaware,) = gains_beyond_margin(seen, alone).values()
    assert abs(both[truth.hidden[0].name] - unaware) > 1.0


def test_what_the_data_show_needs_no_fit() -> None:
    seen, truth = blind_loop(37)
    assert truth.cause == "data time_shift"
    assert list(gains_beyond_margin(seen, truth).values()) == [math.inf]


def test_nothing_hidden_has_no_gain() -> None:
    seen, truth = blind_loop(29)
    assert truth.cause == "none"
    assert gains_beyond_margin(seen, truth) == {}
