"""The part of a run's report that tells what the monitor saw."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stiction_ros.pages.frame import words
from stiction_ros.records.run.log import RunLog
from stiction_ros.report.page import Cell, duration, number, table


def monitor_section(log: RunLog) -> str:
    """Return every measurement of the gap with what was found; empty without a monitor."""
    looks = log.gaps.looks
    if not looks:
        return ""
    rows: list[list[Cell]] = []
    for stamp, look in looks.items():
        found = log.gaps.findings.get(stamp, {})
        outputs = look.get("outputs", {})
        rows.append(
            [
                duration(log.seconds(stamp)),
                ("bad", "grown") if look.get("grown") else "as in the baseline",
                str(found.get("text", "")) or str(look.get("failure", "")),
                ", ".join(f"{name} {_growth(one)}" for name, one in outputs.items()),
            ]
        )
    grown = sum(bool(look.get("grown")) for look in looks.values())
    said = f"The gap between loop and model was measured {len(looks)} times; "
    said += f"in {grown} of them it had grown." if grown else "it never grew."
    head = ("window ends", "gap", "found", "times the baseline’s (limit)")
    return f"<h2>The monitor</h2><p>{words(said)}</p>" + table(head, rows, texts=3)


def _growth(look: Mapping[str, Any]) -> str:
    gap, baseline, limit = (look.get(key) for key in ("gap", "baseline", "limit"))
    share = gap / baseline if isinstance(gap, float) and baseline else None
    return f"{number(share)} ({number(limit)})"
