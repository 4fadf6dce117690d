"""What a bag tells of the monitor: measurements of the gap, and what was found."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping
from typing import Any

from stiction_ros.records.bag.messages import BagMessage, last_part

_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


@dataclasses.dataclass(frozen=True)
class GapLog:
    """What the monitor told, by the end of its window in ns.

    Attributes:
        looks: documents of the measurements.
        findings: documents of what the workflow found.
    """

    looks: Mapping[int, Mapping[str, Any]]
    findings: Mapping[int, Mapping[str, Any]]


def gap_log(messages: Iterable[BagMessage]) -> GapLog:
    """Return what the diagnostics among ``messages`` tell of the monitor, in order of time."""
    found: dict[str, dict[int, Mapping[str, Any]]] = {"look": {}, "finding": {}}
    for message in messages:
        if message.type != _DIAGNOSTICS or last_part(message.topic)[1] != "diagnostics":
            continue
        for status in message.message.status:
            values = {item.key: item.value for item in status.values}
            end = values.get("window_end", "")
            for kind, told in found.items():
                document = _document(values.get(kind, ""))
                if document is not None and end.isdecimal():
                    told[int(end)] = document
    looks, findings = (dict(sorted(told.items())) for told in found.values())
    return GapLog(looks, findings)


def _document(text: str) -> Mapping[str, Any] | None:
    if not text:
        return None
    try:
        document = json.loads(text)
    except json.JSONDecodeError:
        return None
    return document if isinstance(document, dict) else None
