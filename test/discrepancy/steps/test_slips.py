"""Steps that another one takes back, beside a friction."""

import types
from typing import Any, cast

import numpy as np

from stiction_ros.discrepancy.decision.explanation import AddedEffect
from stiction_ros.discrepancy.steps.settle import band_of, without_slips
from stiction_ros.effects import Backlash, Behaviour, HeStiction, StepDisturbance


def added(place: str, behaviour: Behaviour, point: list[float], *factors: float) -> AddedEffect:
    """Return an effect by what is asked of it here."""
    candidate = types.SimpleNamespace(
        place=place, effect=behaviour.effect, key=(place, behaviour.effect), dated=bool(factors)
    )
    fit = types.SimpleNamespace(
        candidate=candidate, behaviour=behaviour, point=np.array(point), factors=np.array(factors)
    )
    return AddedEffect(cast(Any, fit))


def step(time: float, size: float) -> AddedEffect:
    return added("load:V1", StepDisturbance(time, size), [time], size)


STICKY = added("valve:V1", HeStiction(4.0, 1.5), [5.5, 0.4])


def test_opposite_steps_without_a_friction_stay() -> None:
    steps = (step(100.0, 2.0), step(300.0, -2.0))
    assert without_slips(steps) == steps


def test_beside_a_friction_they_are_a_stem_that_stood_elsewhere() -> None:
    assert without_slips([STICKY, step(100.0, 2.0), step(300.0, -2.0)]) == (STICKY,)


def test_larger_ones_than_its_band_stay_beside_a_friction() -> None:
    effects = (STICKY, step(100.0, 7.0), step(300.0, -7.0))
    assert without_slips(effects) == effects


def test_the_band_of_a_play_is_its_own() -> None:
    assert band_of(added("valve:V1", Backlash(3.0), [3.0])) == 3.0


def test_the_band_of_stiction_is_both_frictions() -> None:
    assert band_of(STICKY) == 5.5
