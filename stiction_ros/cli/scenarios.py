"""The scenarios that come along, and the parameters of their nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stiction_ros.config_files import find_config
from stiction_ros.online.session import Scenario

SCENARIOS = ("tank", "siso")


def load(name: str) -> Scenario:
    """Return a scenario by name; InputError when there is none of that name."""
    return Scenario.load(find_config(f"{name}.scenario.yaml"))


def node_parameters(name: str, directory: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of all nodes with full paths; the bag goes below ``directory``."""
    path = find_config(f"{name}.scenario.yaml")
    nodes = {node: dict(values) for node, values in Scenario.load(path).nodes.items()}
    for values in nodes.values():
        for key in ("model", "set_points"):
            if key in values:
                values[key] = str((path.parent / values[key]).resolve())
    nodes["recorder"]["directory"] = str((directory / "bag").resolve())
    return nodes
