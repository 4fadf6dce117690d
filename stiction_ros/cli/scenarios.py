"""The scenarios that come along, and the parameters of their nodes.

The command ``demo`` and the launch file start the same nodes with the same parameters: both
take them from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError

SCENARIOS = ("tank", "siso")
STARTED = ("recorder", "estimator", "controller", "plant")
"""The nodes of a loop, in the order in which they are started."""


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
    from stiction_ros.online.session import Scenario

    nodes = {node: dict(values) for node, values in Scenario.load(path).nodes.items()}
    for values in nodes.values():
        for key in ("model", "set_points", "monitor_model"):
            if values.get(key):
                values[key] = str((path.parent / values[key]).resolve())
    nodes["recorder"]["directory"] = str((directory / "bag").resolve())
    return nodes


def loop_nodes(
    path: Path, directory: Path, *, seed: int | None = None, speed: float | None = None
) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes of a loop, by name, in the order of their start.

    Args:
        path: scenario file.
        directory: where the bag goes.
        seed: of the noise; None for that of the scenario.
        speed: simulated seconds per second; None for lockstep, as fast as the machine can.
    """
    nodes = node_parameters(path, directory)
    if seed is not None:
        nodes["plant"]["seed"] = seed
    if speed is not None:
        for name in ("plant", "controller", "estimator"):
            nodes[name].update(pace="realtime", speed=float(speed))
    return {name: nodes[name] for name in STARTED}


def write_parameters(
    nodes: Mapping[str, Mapping[str, Any]], path: Path, *, any_namespace: bool = False
) -> None:
    """Write a ROS parameter file for ``nodes``, which may be in a namespace."""
    prefix = "/**/" if any_namespace else ""
    document = {f"{prefix}{n}": {"ros__parameters": dict(v)} for n, v in nodes.items()}
    path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
