"""What holds for every effect, whichever file it is in."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from stiction_ros.effects import Behaviour, behaviours, from_mapping
from stiction_ros.errors import InputError

every_behaviour = pytest.mark.parametrize("kind", behaviours(), ids=lambda kind: kind.title())


def example(kind: type[Behaviour]) -> dict[str, Any]:
    """A valid mapping; equal values keep f_d ≤ f_s."""
    head: dict[str, Any] = {"effect": kind.effect}
    if kind.law is not None:
        head["law"] = kind.law
    return head | {p.key: min(max(1.5, p.low), p.high) for p in kind.parameters()}


@every_behaviour
def test_every_field_is_a_documented_parameter(kind: type[Behaviour]) -> None:
    assert [p.attribute for p in kind.parameters()] == [f.name for f in dataclasses.fields(kind)]
    for entry in kind.parameters():
        assert len(entry.description) > 5
        assert entry.unit
        assert entry.key.islower()
        assert entry.low < entry.high


@every_behaviour
def test_keys_are_unique(kind: type[Behaviour]) -> None:
    keys = [p.key for p in kind.parameters()]
    assert len(set(keys)) == len(keys)


@every_behaviour
def test_a_mapping_survives_the_round_trip(kind: type[Behaviour]) -> None:
    built = from_mapping(example(kind))
    assert type(built) is kind
    assert built.to_mapping() == example(kind)
    assert from_mapping(built.to_mapping()) == built


@every_behaviour
def test_a_misspelt_key_is_refused_with_the_known_ones(kind: type[Behaviour]) -> None:
    with pytest.raises(InputError) as caught:
        from_mapping(example(kind) | {"sizze": 1.0})
    assert "'sizze'" in caught.value.what
    assert kind.parameters()[0].key in caught.value.fix


@every_behaviour
def test_a_missing_key_is_named(kind: type[Behaviour]) -> None:
    values = example(kind)
    key = kind.parameters()[0].key
    del values[key]
    with pytest.raises(InputError, match=repr(key)):
        from_mapping(values)


@every_behaviour
@pytest.mark.parametrize("bad", [math.nan, math.inf, "one", None, True, [1.0]])
def test_what_is_no_finite_number_is_refused(kind: type[Behaviour], bad: object) -> None:
    key = kind.parameters()[0].key
    with pytest.raises(InputError) as caught:
        from_mapping(example(kind) | {key: bad})
    assert caught.value.where == key


@every_behaviour
def test_a_behaviour_is_frozen(kind: type[Behaviour]) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(from_mapping(example(kind)), kind.parameters()[0].attribute, 2.0)


@every_behaviour
def test_simulate_is_step_after_step(kind: type[Behaviour]) -> None:
    behaviour = from_mapping(example(kind))
    values = np.random.default_rng(1).uniform(-5.0, 5.0, 30)
    memory, expected = behaviour.rest(1.0), []
    for k, value in enumerate(values.tolist()):
        memory, out = behaviour.step(memory, value, 2.0 * k)
        expected.append(out)
    assert behaviour.simulate(values, 1.0, sample_time=2.0).tolist() == expected


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"effect": "stikction"}, "unknown effect 'stikction'"),
        ({"effect": ["stiction"]}, "unknown effect"),
        ({"effect": "stiction", "law": "hee", "f_s": 1.0, "f_d": 0.0}, "unknown law 'hee'"),
        ({"f_s": 1.0}, "is no effect"),
        ("stiction", "is no effect"),
        (None, "is no effect"),
    ],
)
def test_what_is_no_effect_is_refused_with_a_mend(values: Any, said: str) -> None:
    with pytest.raises(InputError) as caught:
        from_mapping(values)
    assert said in caught.value.what
    assert caught.value.fix


def test_an_effect_without_a_law_takes_its_first_one() -> None:
    assert from_mapping({"effect": "stiction", "f_s": 1.0, "f_d": 0.5}).law == "he"
