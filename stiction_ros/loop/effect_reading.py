"""Lists of effects in a loop model."""

from __future__ import annotations

from stiction_ros.effects import Behaviour
from stiction_ros.effects import from_mapping as effect_from_mapping
from stiction_ros.errors import InputError
from stiction_ros.loop.reading import Section


def read_effects(section: Section) -> tuple[Behaviour, ...]:
    """Return the behaviours of the key ``effects``, none where it is absent.

    Raises:
        InputError: naming the entry at fault.
    """
    effects = []
    for entry in section.sections("effects", []):
        try:
            effects.append(effect_from_mapping(entry.values))
        except InputError as error:
            raise error.within(entry.where) from None
    return tuple(effects)
