"""Results as JSON, to a file or to standard output."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from stiction_ros.errors import storing
from stiction_ros.texts import json_text


def write_json(target: str, value: Any) -> None:
    """Write ``value`` to the file ``target``, or to standard output for ``-``."""
    text = json_text(value)
    if target == "-":
        print(text)
        return
    with storing(target):
        Path(target).write_text(text + "\n", encoding="utf-8")


def hand_over(target: str | None, value: Any, show: Callable[[], object]) -> None:
    """Write a result as JSON where ``--json`` asks for it, and show it unless that is on ``-``."""
    if target is not None:
        write_json(target, value)
    if target != "-":
        show()
