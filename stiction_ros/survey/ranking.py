"""In which order loops are serviced: the one rule, and its reason.

1. *Kind*: valves found that make their loop cycle; those found whose cycle has another cause;
   undecided valves; healthy valves in loops that cycle; the rest; what was not judged.
2. Among one kind *P × what a service would bring*: the probability of friction by the share of the
   loop's movement that goes away without the friction, simulated; where a cost was given it
   is multiplied by what the cycle costs over the median of what was given.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.survey.entry import Entry, Status


def kind(entry: Entry) -> int:
    """Return the kind of a loop, 0 first."""
    if entry.status is not Status.OK:
        return 5
    if entry.found:
        return 0 if entry.cause == "valve" else 1
    if entry.verdict == "undecided":
        return 2
    return 3 if entry.cause not in (None, "none") else 4


def ranked(entries: Sequence[Entry], costs: Mapping[str, float]) -> list[Entry]:
    """Return the entries in their order with rank and what their cycles cost.

    The ``costs`` by name are money per hour for a |PV − SP| of one engineering unit.
    """
    priced = [
        dataclasses.replace(entry, cost_per_hour=_cost(entry, costs.get(entry.name)))
        for entry in entries
    ]
    known = [entry.cost_per_hour for entry in priced if entry.cost_per_hour]
    usual = float(np.median(known)) if known else 1.0

    def worth(entry: Entry) -> float:
        money = 1.0 if entry.cost_per_hour is None else entry.cost_per_hour / usual
        gone = min(max(entry.evidence.get("loop_gone", 0.0), 0.0), 1.0) if entry.found else 1.0
        return (entry.probability or 0.0) * gone * money

    order = sorted(priced, key=lambda entry: (kind(entry), -worth(entry), entry.name))
    return [dataclasses.replace(entry, rank=place) for place, entry in enumerate(order, start=1)]


def _cost(entry: Entry, cost: float | None) -> float | None:
    """Return what the cycle costs an hour: what a service saves, else the mean of a sine."""
    if cost is None or entry.status is not Status.OK:
        return None
    if entry.gain:
        now, service = entry.gain.get("now") or {}, entry.gain.get("service") or {}
        before, after = now.get("iae_per_hour"), service.get("iae_per_hour")
        if before is not None and after is not None:
            return cost * max(float(before) - float(after), 0.0)
    amplitude = 0.0 if entry.oscillation is None else entry.oscillation.amplitude
    return float(cost * 2.0 / np.pi * amplitude)
