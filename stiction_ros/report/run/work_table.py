"""The rows of a table that tell what the valves had to do, phase by phase."""

from collections.abc import Mapping, Sequence
from typing import Any

KEYS = (
    ("travel", "travel, %/h"),
    ("moves", "moves/h"),
    ("reversals", "reversals/h"),
    ("op_step", "largest OP step, %"),
)


def work_rows(
    summary: Mapping[str, Any], phases: Sequence[str]
) -> list[tuple[str, str, list[float | None]]]:
    """Return rows of a valve, a measure and its value in each of ``phases``; None if unknown."""
    steps, work = summary["largest_op_step"], summary["valve_work"]
    valves = next((list(steps[name]) for name in phases if name in steps), [])
    rows = []
    for valve in valves:
        for key, label in KEYS:
            told = [
                steps.get(name, {}).get(valve)
                if key == "op_step"
                else work.get(name, {}).get(valve, {}).get(key)
                for name in phases
            ]
            rows.append((valve, label, told))
    return rows
