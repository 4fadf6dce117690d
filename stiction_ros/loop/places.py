"""Where an effect acts, and how the YAML of a loop model says so."""

from typing import Any

from stiction_ros.effects import Behaviour
from stiction_ros.effects import from_mapping as effect_from_mapping
from stiction_ros.errors import InputError
from stiction_ros.loop.yaml_reading import Section
from stiction_ros.processes import Process

KINDS = ("valve", "load", "process", "sensor", "disturbance")


def append_effect(
    document: dict[str, Any], place: str, effect: Behaviour, process: Process
) -> None:
    """Add ``effect`` at ``place`` to the YAML mapping ``document`` of a loop model.

    The place is ``valve:TAG``, ``load:TAG``, ``process:TAG``, ``sensor:TAG`` or ``disturbance:TAG``
    of the ``process``; InputError for any other.
    """
    kind, _, tag = place.partition(":")
    if kind not in KINDS:
        raise InputError(
            f"no place {place!r}", fix=f"write {' | '.join(f'{kind}:TAG' for kind in KINDS)}"
        )
    inputs = process.upsets if kind == "disturbance" else ()
    known = process.valves if kind in ("valve", "load") else (*process.outputs, *inputs)
    if tag not in known:
        raise InputError(f"no {kind} {tag!r}", fix=f"use {', '.join(known)}")
    if kind in ("load", "disturbance"):
        end = "load" if kind == "load" else "output" if tag in process.outputs else "input"
        document.setdefault("disturbances", []).append({end: tag} | effect.to_mapping())
        return
    if kind == "valve":
        entries = document["valves"]
    elif kind == "sensor":
        entries = document.setdefault("sensors", [])
    else:
        entries = document["process"].setdefault(
            "outputs", [{"name": name} for name in process.outputs]
        )
    entry = next((entry for entry in entries if entry["name"] == tag), None)
    if entry is None:  # a sensor may have none yet
        entry = {"name": tag}
        entries.append(entry)
    entry.setdefault("effects", []).append(effect.to_mapping())


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
