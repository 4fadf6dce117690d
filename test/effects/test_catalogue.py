"""The page of the catalogue and what the classes say of themselves."""

from __future__ import annotations

from pathlib import Path

import pytest

from stiction_ros.effects import Behaviour, behaviours
from stiction_ros.effects.catalogue import PLACES, page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "effects.md"
every_behaviour = pytest.mark.parametrize("kind", behaviours(), ids=lambda kind: kind.title())


def test_the_page_is_current() -> None:
    again = "run python -m stiction_ros.effects.catalogue > docs/effects.md"
    assert PAGE.read_text(encoding="utf-8") == page(), again


@every_behaviour
def test_every_effect_has_a_place(kind: type[Behaviour]) -> None:
    assert kind.places
    assert set(kind.places) <= set(PLACES)


@every_behaviour
def test_every_effect_says_how_it_shows_and_what_it_needs(kind: type[Behaviour]) -> None:
    for text in (kind.signature, kind.minimum_data):
        assert len(text) > 10
        assert not text.endswith(".")


@every_behaviour
def test_what_it_is_confused_with_is_in_the_catalogue(kind: type[Behaviour]) -> None:
    known = {(place, other.effect) for other in behaviours() for place in other.places}
    assert kind.confusable
    for text in kind.confusable:
        assert tuple(text.split()[:2]) in known


def test_names_of_one_place_are_one_effect() -> None:
    for place in PLACES:
        here = [kind for kind in behaviours() if place in kind.places]
        assert len({(kind.effect, kind.law) for kind in here}) == len(here)
