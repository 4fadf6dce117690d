"""Results as JSON, to a file or to standard output."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from stiction_ros.errors import InputError


def finite(value: Any) -> Any:
    """Return JSON data with null in place of numbers that JSON does not have."""
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_json(target: str, value: Any) -> None:
    """Write ``value`` to the file ``target``, or to standard output for ``-``."""
    text = json.dumps(finite(value), indent=2)
    if target == "-":
        print(text)
        return
    try:
        Path(target).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", where=target) from None
