"""The verdict by evidence, and what it rests on, as tables."""

from __future__ import annotations

import dataclasses

import pytest
from evidence_loops import pi_loop

from stiction_ros.identification import IdentificationOptions, VerdictKind
from stiction_ros.identification.evidence.accepted import Accepted
from stiction_ros.identification.evidence.engine import (
    HARMLESS,
    MATERIAL,
    PRICE,
    _stability,
    _verdict,
)
from stiction_ros.identification.evidence.problem import Problem
from stiction_ros.identification.evidence.rates import Agreement, Look
from stiction_ros.identification.evidence.search import Found, ideal
from stiction_ros.identification.inference.verdict import DEADBAND

STICKY, BACKLASH, HEALTHY, UNDECIDED = VerdictKind
FIGURES = {"delta_bic": 60.0, "half_1": 30.0, "half_2": 30.0, "moves": 40.0}


def held(gain: float, band: tuple[float, float], deadband_loss: float = 50.0) -> Accepted:
    """Return what a rate does not reject; bands are shares of OP's range."""
    return Accepted(band, band, band, gain, gain < 10.0, deadband_loss, ())


@pytest.fixture(scope="module")
def blank() -> Look:
    """A look of which only the range of OP counts."""
    problem = Problem.of(pi_loop(3.0, 1.0, samples=200))
    nothing = ideal(problem)
    return Look(problem, Found(nothing, nothing, (nothing,), (nothing,)), ())


def agreed(blank: Look, *rates: Accepted, alike: bool = True) -> tuple[Agreement, tuple[Look, ...]]:
    """Return looks that hold ``rates``, in shares of OP's range, of which the first counts."""
    seen = tuple(
        dataclasses.replace(
            blank,
            problem=dataclasses.replace(blank.problem, rate=2**k),
            accepted=(one,),
        )
        for k, one in enumerate(rates)
    )
    return Agreement(seen[0], rates[0].gain, alike), seen


@pytest.mark.parametrize(
    ("changes", "rate", "alike", "verdict"),
    [
        ({}, held(75.0, (0.2, 0.3)), True, STICKY),
        ({}, held(75.0, (0.2, 0.3), DEADBAND - 0.1), True, BACKLASH),
        ({}, held(75.0, (0.2, 0.3), DEADBAND + 0.1), True, STICKY),
        ({}, held(75.0, (0.2, 0.3)), False, UNDECIDED),
        ({"half_1": -1.0}, held(75.0, (0.2, 0.3)), True, UNDECIDED),
        ({"half_2": 0.0}, held(75.0, (0.2, 0.3), 0.0), True, UNDECIDED),
        ({"moves": 5.0}, held(75.0, (0.2, 0.3)), True, UNDECIDED),
        ({"delta_bic": -1.0}, held(PRICE - 1.0, (0.2, 0.3)), True, UNDECIDED),
        ({}, held(75.0, (0.9 * MATERIAL, 0.3)), True, UNDECIDED),
        ({"delta_bic": -13.0}, held(2.0, (0.0, 0.9 * HARMLESS)), True, HEALTHY),
        ({"delta_bic": -13.0}, held(2.0, (0.0, 1.1 * HARMLESS)), True, UNDECIDED),
        ({"delta_bic": -13.0, "moves": 5.0}, held(2.0, (0.0, 0.05)), True, UNDECIDED),
        ({"delta_bic": -2.0}, held(PRICE + 1.0, (0.0, 0.05)), True, UNDECIDED),
    ],
)
def test_the_verdict_follows_from_what_the_rates_say(
    blank: Look, changes: dict[str, float], rate: Accepted, alike: bool, verdict: VerdictKind
) -> None:
    found, seen = agreed(blank, rate, alike=alike)
    assert _verdict(FIGURES | changes, found, seen, 0, IdentificationOptions()) is verdict


def test_a_rate_that_hears_friction_keeps_a_valve_from_being_healthy(blank: Look) -> None:
    quiet, loud = held(2.0, (0.0, 0.05)), held(PRICE + 1.0, (0.0, 0.05))
    figures = FIGURES | {"delta_bic": -13.0}
    for others, verdict in (((quiet,), HEALTHY), ((loud,), UNDECIDED)):
        found, seen = agreed(blank, quiet, *others)
        assert _verdict(figures, found, seen, 0, IdentificationOptions()) is verdict


def test_two_rates_that_carry_news_must_have_power_for_a_healthy_valve(blank: Look) -> None:
    blind, sharp = held(2.0, (0.0, 0.9)), held(2.0, (0.0, 0.05))
    figures, options = FIGURES | {"delta_bic": -13.0}, IdentificationOptions()
    found, seen = agreed(blank, blind, sharp, sharp)
    assert _verdict(figures, found, seen, 0, options) is HEALTHY
    found, seen = agreed(blank, blind, sharp, blind)
    assert _verdict(figures, found, seen, 0, options) is UNDECIDED
    found, seen = agreed(blank, sharp, sharp)
    held_back = (dataclasses.replace(seen[0], carries_news=False), seen[1])
    assert _verdict(figures, found, held_back, 0, options) is UNDECIDED


def test_stability_tells_which_rates_and_halves_agree_on_friction(blank: Look) -> None:
    found, seen = agreed(
        blank,
        held(75.0, (0.2, 0.3)),
        held(40.0, (0.25, 0.4)),
        held(40.0, (0.6, 0.7)),
        held(PRICE - 1.0, (0.2, 0.3)),
    )
    told = _stability(seen, found, 0, FIGURES | {"half_2": -3.0}, (False, 0.5))
    assert told.agreed == ("rows of 0.5 s", "rows of 1 s", "first half")
    assert told.share == 0.5
    assert [look.gain for look in told.tried] == [75.0, 40.0, 40.0, PRICE - 1.0, 30.0, -3.0]
    document = told.to_json()
    assert document["agreed"] == list(told.agreed)
    assert document["tried"][-1] == {
        "look": "second half",
        "gain": -3.0,
        "band": None,
        "agrees": False,
    }


def test_stability_of_a_healthy_valve_counts_looks_that_hear_nothing(blank: Look) -> None:
    found, seen = agreed(blank, held(2.0, (0.0, 0.05)), held(PRICE + 1.0, (0.0, 0.05)))
    figures = FIGURES | {"half_1": 1.0, "half_2": PRICE + 1.0}
    told = _stability(seen, found, 0, figures, (True, 1.0))
    assert told.agreed == ("rows of 1 s", "first half")
