"""Results as JSON, to a file or to standard output."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stiction_ros.errors import InputError
from stiction_ros.json_values import json_text


def write_json(target: str, value: Any) -> None:
    """Write ``value`` to the file ``target``, or to standard output for ``-``."""
    text = json_text(value)
    if target == "-":
        print(text)
        return
    try:
        Path(target).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", where=target) from None
