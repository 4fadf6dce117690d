"""Commands, and parts of commands, that another distribution brings.

It names a table by an entry point of the group ``stiction.commands``: commands, or parts as they
are typed (``demo opcua``), to their module and what ``--help`` says.
"""

import functools
import importlib
from collections.abc import Mapping
from importlib import metadata
from typing import Any, NoReturn

from stiction_ros.errors import InputError

GROUP = "stiction.commands"
STUDIES = "stiction-studies"
OF_STUDIES = (
    *("bench", "calibrate", "example", "faults", "paper", "soak", "study", "study-change"),
    *("study-control", "study-monitor", "demo opcua", "demo --compare", "experiment"),
)
"""What ``stiction-studies`` brings, so that the command can say so where it is not installed."""

Table = Mapping[str, tuple[str, str]]


@functools.cache
def brought() -> Table:
    """Return module and help of all that other distributions bring, by name."""
    found: dict[str, tuple[str, str]] = {}
    for entry in metadata.entry_points(group=GROUP):
        found |= entry.load()
    return found


def commands() -> Table:
    """Return module and help of the whole commands among them, by name."""
    return {name: told for name, told in brought().items() if " " not in name}


def part(name: str) -> Any | None:
    """Return the module of a part of a command; None where nothing brings it."""
    table = brought()
    return importlib.import_module(table[name][0]) if name in table else None


def refuse(name: str) -> NoReturn:
    """Raise InputError: the command, or the part of one, comes with the studies."""
    raise InputError(
        f"comes with the distribution {STUDIES}, which is not installed",
        where=f"stiction {name}",
        fix=f"install {STUDIES} beside stiction_ros",
    )
