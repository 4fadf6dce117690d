"""The scenarios that come along, and the parameters of their nodes, for demo and launch."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError

SCENARIOS = ("tank", "siso")  # those that are run where none is named
ALL = (*SCENARIOS, "siso_test", "tank_test", "neighbours", "cascade")
STARTED = ("recorder", "estimator", "controller", "plant")  # in this order


def find(name: str) -> Path:
    """Return the file of a scenario: one that comes along, or a ``*.yaml`` file of the user."""
    if name.endswith((".yaml", ".yml")):
        return find_config(name)
    if name in ALL:
        return find_config(f"{name}.scenario.yaml")
    raise InputError(
        f"unknown scenario {name!r}",
        fix=f"use {', '.join(ALL)}, or the path of a *.scenario.yaml file",
    )


def node_parameters(path: Path, directory: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of all nodes with full paths; the bag goes below ``directory``."""
    from stiction_ros.online.unit import load_scenario

    return _placed(load_scenario(path).nodes, path, directory)


def _placed(
    told: Mapping[str, Mapping[str, Any]], path: Path, directory: Path
) -> dict[str, dict[str, Any]]:
    nodes = {node: dict(values) for node, values in told.items()}
    for values in nodes.values():
        for key in ("model", "set_points", "monitor_model"):
            if values.get(key):
                values[key] = str((path.parent / values[key]).resolve())
    nodes["recorder"]["directory"] = str((directory / "bag").resolve())
    return nodes


def loop_nodes(
    path: Path, directory: Path, *, seed: int | None = None, speed: float | None = None
) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes of a loop in order of start; no speed is lockstep."""
    nodes = node_parameters(path, directory)
    if seed is not None:
        nodes["plant"]["seed"] = seed
    if speed is not None:
        for name in nodes.keys() - {"recorder"}:
            nodes[name].update(pace="realtime", speed=float(speed))
    return {name: nodes[name] for name in in_order(nodes, STARTED)}


def kind_of(name: str) -> str:
    """Return what a node is that may be in a namespace: ``controller`` of ``TC1/controller``."""
    return name.rpartition("/")[2]


def in_order(names: Iterable[str], kinds: Sequence[str]) -> list[str]:
    """Return names of nodes in the order of their kinds."""
    return sorted(names, key=lambda name: kinds.index(kind_of(name)))


def bridged_nodes(
    path: Path, directory: Path, source: str, *, speed: float = 1.0
) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes of a loop whose plant is behind a bridge, or elsewhere.

    The ``source`` is what the others wait for in place of the plant, an entry of ``wait_for``.
    """
    from stiction_ros.online.session import read_nodes

    nodes = _placed(read_nodes(path, without="plant"), path, directory)
    others = [name for name in STARTED if name != "plant"]
    for name in ("controller", "estimator"):
        partners = [source, *(other for other in others if other != name)]
        nodes[name].update(pace="realtime", speed=float(speed), wait_for=partners)
    return {name: nodes[name] for name in others}


def write_parameters(nodes: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Write a ROS parameter file for ``nodes``, which may be in any namespace."""
    document = {f"/**/{n}": {"ros__parameters": dict(v)} for n, v in nodes.items()}
    path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
