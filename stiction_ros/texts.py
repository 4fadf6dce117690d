"""Values and times as texts: JSON that every reader takes, times as people say them."""

import json
import math
from collections.abc import Mapping
from typing import Any

HOUR, DAY = 3600.0, 86400.0


def finite(value: Any) -> Any:
    """Return JSON data with None in place of numbers that JSON does not have."""
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def json_text(value: Any, *, indent: int | None = 2) -> str:
    """Return ``value`` as JSON text, never with NaN or Infinity."""
    return json.dumps(finite(value), indent=indent, ensure_ascii=False, allow_nan=False)


def plural(count: int, what: str) -> str:
    """Return ``1 row`` or ``3 rows``."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def probability(value: float | None) -> str:
    """Return a probability with three decimals, neither 0 nor 1; nothing where there is none."""
    return "" if value is None else f"{min(max(value, 0.001), 0.999):.3f}"


def symbol(key: str) -> str:
    """Return the key of a parameter as it is read: ``f_S`` of ``f_s``, blanks in place of ``_``."""
    return {"f_s": "f_S", "f_d": "f_D"}.get(key, key.replace("_", " "))


def spoken(seconds: float | None) -> str:
    """Return a time of three digits in the unit that suits it: ``45.5 s``, ``4.78 h``, ``12.3 d``.

    Args:
        seconds: not negative; whole ones are kept below an hour; a dash where there is none.

    Examples:
        >>> spoken(45.52), spoken(1234.0), spoken(17210.0)
        ('45.5 s', '1234 s', '4.78 h')
    """
    if seconds is None or not math.isfinite(seconds):
        return "–"
    if seconds < HOUR:
        return f"{seconds:.3g} s" if seconds < 1000.0 else f"{seconds:.0f} s"
    size, unit = (HOUR, "h") if seconds < 2.0 * DAY else (DAY, "d")
    return f"{seconds / size:.3g} {unit}"


def moment(seconds: float | None) -> str:
    """Return a time on the clock of a run to the second, as moments are compared; a dash for none.

    Examples:
        >>> moment(5000.2), moment(None)
        ('5000 s', '–')
    """
    return "–" if seconds is None else f"{seconds:.0f} s"
