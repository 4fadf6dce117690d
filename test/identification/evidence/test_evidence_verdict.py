"""The verdict by evidence, and what it rests on, as tables."""

from __future__ import annotations

import dataclasses

import pytest
from evidence_loops import pi_loop

from stiction_ros.identification import IdentificationOptions, VerdictKind
from stiction_ros.identification.closed_loop.explanation import SURE
from stiction_ros.identification.evidence.accepted import Accepted
from stiction_ros.identification.evidence.engine import _stability
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.rates import PRICE, Agreement, Look
from stiction_ros.identification.evidence.search import Found, ideal
from stiction_ros.identification.evidence.verdict import (
    MATERIAL,
    REJECTED,
    SURELY,
    verdict_of,
)
from stiction_ros.identification.inference.verdict import DEADBAND, OF_FEW

STICKY, BACKLASH, HEALTHY, UNDECIDED = VerdictKind
FIGURES = {"delta_bic": 60.0, "half_1": 30.0, "half_2": 30.0, "moves": 40.0}


def held(
    gain: float,
    band: tuple[float, float],
    deadband_loss: float = 50.0,
    material_gain: float | None = None,
) -> Accepted:
    """Return what a rate does not reject; bands are shares of OP's range."""
    material = gain if material_gain is None else material_gain
    return Accepted(band, band, band, gain, gain < 10.0, deadband_loss, material, ())


def rejected(lost: float) -> Accepted:
    """Return a rate at which all bands that would matter lose against none."""
    return held(2.0, (0.0, 0.05), material_gain=-lost)


@pytest.fixture(scope="module")
def blank() -> Look:
    """A look of which only the range of OP counts."""
    problem = Problem.of(pi_loop(3.0, 1.0, samples=200))
    nothing = ideal(problem)
    return Look(problem, Found(nothing, nothing, (nothing,), (nothing,)), ())


@pytest.fixture(autouse=True)
def sighted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every rate with news see the process, and speak of one that is held."""
    monkeypatch.setattr(Look, "speaks", lambda look, valve: True)
    monkeypatch.setattr(Look, "sees_process", lambda look, valve: look.carries_news)


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
        ({"moves": 11.0, "delta_bic": OF_FEW + 0.1}, held(75.0, (0.2, 0.3)), True, STICKY),
        ({"moves": 11.0, "delta_bic": OF_FEW - 0.1}, held(75.0, (0.2, 0.3)), True, UNDECIDED),
        ({"moves": 12.0, "delta_bic": OF_FEW - 0.1}, held(75.0, (0.2, 0.3)), True, STICKY),
        ({"delta_bic": -1.0}, held(PRICE - 1.0, (0.2, 0.3)), True, UNDECIDED),
        ({}, held(75.0, (0.9 * MATERIAL, 0.3)), True, UNDECIDED),
        ({"delta_bic": -13.0}, rejected(SURELY + 0.1), True, HEALTHY),
        ({"delta_bic": -13.0}, rejected(SURELY - 0.1), True, UNDECIDED),
        ({"delta_bic": -13.0, "moves": 5.0}, rejected(30.0), True, UNDECIDED),
        ({"delta_bic": -2.0}, held(PRICE + 1.0, (0.0, 0.3)), True, UNDECIDED),
    ],
)
def test_the_verdict_follows_from_what_the_rates_say(
    blank: Look, changes: dict[str, float], rate: Accepted, alike: bool, verdict: VerdictKind
) -> None:
    found, seen = agreed(blank, rate, alike=alike)
    assert verdict_of(FIGURES | changes, found, seen, 0, IdentificationOptions()) is verdict


@pytest.mark.parametrize(
    ("others", "is_held", "verdict"),
    [
        ([rejected(REJECTED + 0.1)] * 2, False, UNDECIDED),
        ([rejected(REJECTED + 0.1)] * 2, True, STICKY),
        ([rejected(REJECTED + 0.1), rejected(REJECTED - 0.1)], False, STICKY),
    ],
)
def test_friction_beside_another_process_is_none_where_two_rates_that_see_it_reject_it(
    blank: Look, others: list[Accepted], is_held: bool, verdict: VerdictKind
) -> None:
    found, seen = agreed(blank, held(75.0, (0.2, 0.3)), *others)
    found = dataclasses.replace(found, held=is_held)
    assert verdict_of(FIGURES, found, seen, 0, IdentificationOptions()) is verdict


@pytest.mark.parametrize(
    ("rates", "verdict"),
    [
        ([rejected(SURELY + 1.0), rejected(0.1)], HEALTHY),
        ([rejected(SURELY + 1.0), rejected(-0.1)], UNDECIDED),
        ([rejected(REJECTED + 0.1)], UNDECIDED),
        ([rejected(REJECTED + 0.1)] * 2, HEALTHY),
        ([rejected(REJECTED + 0.1), rejected(REJECTED - 0.1)], UNDECIDED),
        ([*[rejected(REJECTED + 0.1)] * 2, rejected(0.0)], HEALTHY),
        ([*[rejected(30.0)] * 3, rejected(-0.1)], UNDECIDED),
    ],
)
def test_a_valve_is_healthy_where_rates_reject_all_that_matters_and_none_finds_it(
    blank: Look, rates: list[Accepted], verdict: VerdictKind
) -> None:
    found, seen = agreed(blank, *rates)
    figures = FIGURES | {"delta_bic": -13.0}
    assert verdict_of(figures, found, seen, 0, IdentificationOptions()) is verdict


@pytest.mark.parametrize(
    ("gain", "verdict"), [(PRICE + SURE - 1.0, HEALTHY), (PRICE + SURE + 1.0, UNDECIDED)]
)
def test_rows_without_news_acquit_no_valve_and_speak_for_friction_when_sure(
    blank: Look, gain: float, verdict: VerdictKind
) -> None:
    figures, options = FIGURES | {"delta_bic": -13.0}, IdentificationOptions()
    found, seen = agreed(blank, held(gain, (0.1, 0.2)), rejected(30.0), rejected(30.0))
    told = (dataclasses.replace(seen[0], carries_news=False), *seen[1:])
    assert verdict_of(figures, found, told, 0, options) is verdict
    silent = tuple(dataclasses.replace(look, carries_news=False) for look in seen[1:])
    assert verdict_of(figures, found, silent, 0, options) is UNDECIDED


def test_what_gains_beside_a_process_that_no_controller_holds_is_nothing(
    blank: Look, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures, options = FIGURES | {"delta_bic": -13.0}, IdentificationOptions()
    found, seen = agreed(blank, *[rejected(30.0)] * 2, held(PRICE + SURE + 1.0, (0.1, 0.2)))
    assert verdict_of(figures, found, seen, 0, options) is UNDECIDED
    monkeypatch.setattr(Look, "speaks", lambda look, valve: look.problem.rate != 4)
    assert verdict_of(figures, found, seen, 0, options) is HEALTHY


def test_where_a_rate_finds_a_small_friction_a_valve_is_not_healthy(blank: Look) -> None:
    figures, options = FIGURES | {"delta_bic": -13.0}, IdentificationOptions()
    for gain, verdict in ((PRICE - 1.0, HEALTHY), (PRICE + 1.0, UNDECIDED)):
        small = dataclasses.replace(rejected(30.0), gain=gain)
        found, seen = agreed(blank, small, *[rejected(30.0)] * 2)
        assert verdict_of(figures, found, seen, 0, options) is verdict


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
