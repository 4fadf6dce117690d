"""Valve stiction in model predictive control: simulate, identify, compensate, record.

What :data:`__all__` lists is the public face, which ``__init__.pyi`` imports for type checkers; it
is loaded when it is used, so that importing the package costs nothing. Everything else in the
sub-packages may change from one version to the next.

Floors, lowest first; each imports only what stands below it, and nothing below
:mod:`stiction_ros.nodes` imports rclpy::

    effects  processes  records  intake  loop  identification  discrepancy, control  paper
    control_settings  online  opcua  gain  survey  report  cli  nodes

Examples:
    >>> from stiction_ros import LoopModel, find_config, identify, simulate
    >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=600)
    >>> print(identify(record).valves[0].verdict)
    sticky
"""

import ast
import importlib
from pathlib import Path
from typing import Any

__version__ = "0.1.0"

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOMES = {
    alias.asname or "find_gap": (str(node.module), alias.name)
    for node in ast.parse(_STUB).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
"""Name: the module that has it, and its name there."""

__all__ = sorted((*_HOMES, "__version__"))


def __getattr__(name: str) -> Any:
    """Load a public name at its first use (PEP 562)."""
    if name == "effects":
        return importlib.import_module("stiction_ros.effects")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, there = _HOMES[name]
    value = getattr(importlib.import_module(module), there)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names beside what is loaded."""
    return sorted({*globals(), *__all__})
