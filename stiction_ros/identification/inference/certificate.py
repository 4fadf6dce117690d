"""Sentences on what of an identified friction is exact and what was searched."""

from __future__ import annotations

from collections.abc import Sequence

from stiction_ros.identification.result.identification import ValveEstimate


def certificates(valves: Sequence[ValveEstimate]) -> tuple[str, ...]:
    """Return one sentence per valve that has friction."""
    return tuple(_certificate(valve) for valve in valves if valve.static_friction > 0.0)


def _certificate(valve: ValveEstimate) -> str:
    patterns = int(valve.evidence["patterns"])
    head = f"friction of {valve.name} (law {valve.law})"
    if not patterns:
        return f"{head}: searched on grids only, no switching pattern was enumerated"
    if valve.evidence["patterns_closed"]:
        reach = "exact among them, all at their edge are rejected"
    else:
        reach = "exact among them, but not all at their edge are rejected"
    return f"{head}: {patterns} switching patterns enumerated round it; {reach}"
