"""Valves that change in mid-run: serviced, worn, replaced."""

import dataclasses
from typing import Any

import yaml

from stiction_ros.effects import Behaviour
from stiction_ros.errors import InputError
from stiction_ros.loop.places import read_effects
from stiction_ros.loop.yaml_reading import Section, parse_yaml


@dataclasses.dataclass(frozen=True)
class ValveChange:
    """From the first sample at or after a time on, a valve has other effects.

    The stem stays where it is, and the new effects begin at rest there.
    """

    time: float  # seconds since the first sample
    valve: str  # tag
    effects: tuple[Behaviour, ...]  # in signal order; none for a valve that follows OP


def read_valve_changes(
    value: Any, valves: tuple[str, ...], where: str = "valve_changes"
) -> tuple[ValveChange, ...]:
    """Return the changes in the order of their times.

    The ``value`` is a list of ``{time, valve, effects}``, or that as YAML text, as a ROS parameter
    holds it; empty for none. The error names the entry at fault.
    """
    if isinstance(value, str):
        value = parse_yaml(value, where) if value.strip() else []
    if not isinstance(value, list | tuple):
        raise InputError(
            "is no list of changes",
            where=where,
            fix="write [{time: 1000.0, valve: V1, effects: []}]",
        )
    changes = []
    for i, entry in enumerate(value):
        section = Section(entry, f"{where}[{i}]")
        time, valve = section.number("time", low=0.0), section.choice("valve", valves)
        section.raw("effects")  # a change to no effects is said, not left out
        changes.append(ValveChange(time, valve, read_effects(section, "valve")))
        section.finish()
    return tuple(sorted(changes, key=lambda change: change.time))


def valve_changes_text(value: Any) -> str:
    """Return ``value``, a list or text, as the text that a ROS parameter can hold."""
    if isinstance(value, str):
        return value
    return yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=2**20).strip()
