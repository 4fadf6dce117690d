"""The probability of an effect: by how far it is ahead, and shared within a set."""

import json
import math
from importlib.resources import files
from typing import Any, cast

import numpy as np
import pytest

from stiction_ros.discrepancy.answer.found_effects import FoundEffect
from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.decision import probability
from stiction_ros.discrepancy.decision.explanation import AddedEffect
from stiction_ros.discrepancy.decision.probability import FILE, Coefficients, Standing, standing
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Backlash, Behaviour, FloatArray

STICTION, BACKLASH = ("valve:V1", "stiction"), ("valve:V1", "backlash")
LAG, POLE = ("valve:V1", "lag"), ("process:PV1", "pole")


class Named(Candidate):
    """A candidate that is only a name."""

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        raise NotImplementedError

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour | None:
        raise NotImplementedError


def fit(name: tuple[str, str], evidence: float, **more: Any) -> CandidateFit:
    candidate = Named(place=name[0], effect=name[1], axes=(), **more)
    return CandidateFit(candidate, np.zeros(0), np.zeros(0), {}, evidence, 0.0)


def test_what_was_fitted_is_installed_and_read() -> None:
    told = json.loads(files(probability.__package__).joinpath(FILE).read_text("utf-8"))
    assert probability.shipped() == Coefficients(*(told[k] for k in Coefficients._fields))
    assert told["slope"] > 0.0
    assert told["loops"] > 0
    assert told["fitted_to"]


def test_the_farther_ahead_the_likelier() -> None:
    alone = [Standing(e, (LAG,)).probabilities()[LAG] for e in (-30.0, 0.0, 1.0, 10.0, 1e3, 1e6)]
    assert alone == sorted(alone)
    assert alone[0] == alone[1] < alone[2] < alone[-1] < 1.0


def test_a_set_shares_its_probability_equally() -> None:
    by = Coefficients(1.0, 0.5)
    whole = Standing(40.0, (LAG,)).probabilities(by)[LAG]
    shared = Standing(40.0, (LAG, POLE, STICTION)).probabilities(by)
    assert sum(shared.values()) == pytest.approx(whole)
    assert shared[LAG] == shared[POLE] == shared[STICTION]


def test_what_is_known_or_contains_an_effect_is_no_rival() -> None:
    fits = (
        fit(STICTION, 100.0),
        fit(BACKLASH, 60.0),
        fit(LAG, 90.0),
        fit(POLE, 30.0),
        fit(("", "any stem"), 150.0, inside=False, contains=(STICTION,)),
    )
    added = AddedEffect(fits[0], (BACKLASH,), fits)
    assert standing(added, ()) == Standing(10.0, (STICTION, BACKLASH))
    assert standing(added, (AddedEffect(fits[2]),)).ahead == 70.0
    alone = AddedEffect(fits[0])
    assert standing(alone, ()) == Standing(100.0, (STICTION,))


def test_twins_and_members_that_were_not_fitted_are_of_the_set() -> None:
    lag = fit(LAG, 50.0, twins=(POLE,))
    gain = ("process:PV1", "gain")
    told = standing(AddedEffect(lag, (POLE, gain), (lag,)), ())
    assert told == Standing(50.0, (LAG, POLE, gain))
    likely = told.probabilities()
    assert likely[LAG] == likely[POLE] == likely[gain]


def test_an_entry_of_the_json_has_its_probability_and_those_of_its_alternatives() -> None:
    found = FoundEffect("valve:V1", Backlash(4.0), 200.0, alternatives=(STICTION,))
    entry = cast("Any", found.to_dict())
    (other,) = entry["alternatives"]
    assert {**other, "probability": 0.0} == {
        "place": "valve:V1",
        "effect": "stiction",
        "probability": 0.0,
    }
    assert 0.0 < entry["probability"] == other["probability"] <= 0.5
    assert math.isclose(
        entry["probability"] + other["probability"],
        Standing(200.0, (BACKLASH,)).probabilities()[BACKLASH],
    )
