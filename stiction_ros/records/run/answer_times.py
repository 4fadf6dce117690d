"""How long the loop took to answer, as the plant told it in ``/diagnostics``."""

from __future__ import annotations

import math
from collections.abc import Iterable

from stiction_ros.records.bag.messages import BagMessage, last_part

_KEY = "pv_to_op_ms_"
FIGURES = ("p50", "p99", "p999", "max")


def answer_times(messages: Iterable[BagMessage]) -> dict[str, float]:
    """Return p50, p99, p999 and max of the times from PV to OP, ms; empty in lockstep.

    The figures are of the whole run, so the last ones told count.
    """
    found: dict[str, float] = {}
    for message in messages:
        if last_part(message.topic)[1] != "diagnostics":
            continue
        for status in message.message.status:
            told = {str(item.key): str(item.value) for item in status.values}
            values = {name: _number(told.get(_KEY + name, "")) for name in FIGURES}
            if all(math.isfinite(value) for value in values.values()):
                found = values
    return found


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
