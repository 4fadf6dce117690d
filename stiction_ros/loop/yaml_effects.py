"""Lists of effects in a loop model."""

from __future__ import annotations

from stiction_ros.effects import Behaviour
from stiction_ros.effects import from_mapping as effect_from_mapping
from stiction_ros.errors import InputError
from stiction_ros.loop.yaml_reading import Section


def read_effects(section: Section, place: str) -> tuple[Behaviour, ...]:
    """Return the behaviours of the key ``effects``, none if it is absent; errors name the entry."""
    effects = []
    for entry in section.sections("effects", []):
        try:
            effects.append(at_place(effect_from_mapping(entry.values), place))
        except InputError as error:
            raise error.within(entry.where) from None
    return tuple(effects)


def at_place(effect: Behaviour, place: str) -> Behaviour:
    """Return an effect that may act at a kind of place; one that names no places acts anywhere."""
    if effect.places and place not in effect.places:
        raise InputError(
            f"{effect.title()} cannot act on a {place}",
            where="effect",
            fix=f"it acts on: {', '.join(effect.places)}",
        )
    return effect
