"""The scenarios that come along, and the parameters of their nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.online.session import Scenario

SCENARIOS = ("tank", "siso")


def find(name: str) -> Path:
    """Return the file of a scenario: one that comes along, or a ``*.yaml`` file of the user.

    Raises:
        InputError: neither.
    """
    if name.endswith((".yaml", ".yml")):
        return find_config(name)
    if name in SCENARIOS:
        return find_config(f"{name}.scenario.yaml")
    raise InputError(
        f"unknown scenario {name!r}",
        fix=f"use {' or '.join(SCENARIOS)}, or the path of a *.scenario.yaml file",
    )


def node_parameters(path: Path, directory: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of all nodes with full paths; the bag goes below ``directory``."""
    nodes = {node: dict(values) for node, values in Scenario.load(path).nodes.items()}
    for values in nodes.values():
        for key in ("model", "set_points", "monitor_model"):
            if values.get(key):
                values[key] = str((path.parent / values[key]).resolve())
    nodes["recorder"]["directory"] = str((directory / "bag").resolve())
    return nodes
