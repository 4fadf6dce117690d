"""Settings: frozen dataclasses whose fields carry description and range.

The same declaration checks a parameter file, declares the ROS parameters of a node, and
is printed in the documentation.
"""

import dataclasses
import math
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from stiction_ros.checks import number, one_of
from stiction_ros.errors import InputError

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class Setting:
    """One setting."""

    name: str  # key in a parameter file and name of the ROS parameter
    kind: str  # ``float``, ``int``, ``bool``, ``str``, ``floats`` or ``strings``
    default: Any  # value when not given
    description: str  # one line for people
    low: float  # low, high: closed range of numbers (of each element of a list)
    high: float
    choices: tuple[str, ...]  # accepted texts; empty for any
    fixed: bool  # whether it cannot change while the node is configured
    once: bool  # whether it is read only when the process starts
    # name and value of another setting, without which this one has no effect
    beside: tuple[str, str]


def setting(
    default: Any,
    description: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    choices: tuple[str, ...] = (),
    fixed: bool = False,
    once: bool = False,
    beside: tuple[str, str] = ("", ""),
) -> Any:
    """Declare a field of a settings dataclass."""
    metadata = {"setting": (description, low, high, choices, fixed, once, beside)}
    return dataclasses.field(default=default, metadata=metadata)


_KINDS = {
    float: "float",
    int: "int",
    bool: "bool",
    str: "str",
    tuple[float, ...]: "floats",
    tuple[str, ...]: "strings",
}


def settings_of(cls: type[Any]) -> tuple[Setting, ...]:
    """Return the settings that ``cls`` declares, in order."""
    hints = typing.get_type_hints(cls)
    return tuple(
        Setting(field.name, _KINDS[hints[field.name]], field.default, *field.metadata["setting"])
        for field in dataclasses.fields(cls)
        if "setting" in field.metadata
    )


def check_choices(values: Any) -> None:
    """Raise an InputError where a text of settings made in Python is none of its choices."""
    for entry in settings_of(type(values)):
        if entry.choices:
            one_of(getattr(values, entry.name), entry.choices, entry.name)


def from_mapping(cls: type[T], values: Mapping[str, Any], where: str) -> T:
    """Build ``cls`` from a mapping; absent keys take their defaults.

    Raises:
        InputError: an unknown key, a wrong type, or a value out of range.
    """
    known = {entry.name: entry for entry in settings_of(cls)}
    checked = {}
    for name, value in values.items():
        if name not in known:
            raise InputError(
                f"unknown key {name!r}", where=where, fix=f"known keys: {', '.join(known)}"
            )
        checked[name] = check(known[name], value, where)
    return cls(**checked)


def changed(settings: Any, values: Mapping[str, Any], node: str, configured: bool) -> Any:
    """Return ``settings`` with other ``values``, which take effect in ``node``.

    Args:
        settings: in force.
        values: to be changed, by name.
        node: its full name.
        configured: whether it is; at rest a node reads all when it is configured.

    Raises:
        InputError: a value that cannot be used, or that would change nothing.
    """
    for entry in settings_of(type(settings)):
        if entry.name not in values:
            continue
        value, (other, needed) = check(entry, values[entry.name], node), entry.beside
        where, start = f"{node}: {entry.name}", f"start the node with -p {entry.name}:=VALUE"
        if entry.once:
            raise InputError("is read when the process starts", where=where, fix=start)
        if value == getattr(settings, entry.name):
            continue
        if configured and entry.fixed:
            rest = f"deactivate and clean it up (ros2 lifecycle set {node} …), set it, configure"
            what = "cannot change while the node is configured"
            raise InputError(what, where=where, fix=f"{rest} and activate it; or {start}")
        if configured and other and getattr(settings, other) != needed:
            found = f"{other} is {getattr(settings, other)}"
            raise InputError(f"has no effect while {found}", where=where, fix=f"use {needed}")
        settings = dataclasses.replace(settings, **{entry.name: value})
    return settings


def check(entry: Setting, value: Any, where: str) -> Any:
    """Return ``value`` in the type of ``entry``, or raise InputError.

    Empty texts of a list are left out: ROS has no empty list of texts and writes ``[""]``.
    """
    place = f"{where}: {entry.name}"
    if entry.kind in ("floats", "strings"):
        if isinstance(value, str) or not hasattr(value, "__iter__"):
            raise InputError(f"{value!r} is no list", where=place, fix="write [a, b]")
        return tuple(_check_one(entry, item, place) for item in value if item != "")
    return _check_one(entry, value, place)


def _check_one(entry: Setting, value: Any, place: str) -> Any:
    if entry.kind in ("str", "strings"):
        if not isinstance(value, str):
            raise InputError(f"{value!r} is no text", where=place)
        return one_of(value, entry.choices, place) if entry.choices else value
    if entry.kind == "bool":
        if not isinstance(value, bool):
            raise InputError(f"{value!r} is neither true nor false", where=place)
        return value
    # Only what is infinite when not given, such as a limit, may be.
    defaults = entry.default if isinstance(entry.default, tuple) else (entry.default,)
    unlimited = any(isinstance(d, float) and math.isinf(d) for d in defaults)
    whole, low, high = entry.kind == "int", entry.low, entry.high
    return number(value, place, low=low, high=high, whole=whole, unlimited=unlimited)
