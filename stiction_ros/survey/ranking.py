"""In which order loops are serviced: the one rule, and its reason.

1. *Kind*: valves that stick or have backlash and make their loop cycle; then those found whose
   cycle has another cause, where a service helps less; then valves that the record does not
   decide, which are worth a look; then healthy valves in loops that cycle for another reason,
   which are nobody's work in the valve shop; then the rest; at the end what was not judged.
2. Among one kind *confidence² × worth*, so that a planner who works from the top down finds what
   is surest and largest first; squared, as a valve that is opened for nothing costs a stop and
   the trust in the list. Worth is the band's share of OP's movement, which is what of the
   controller's work never reaches the process; where a cost was given it is multiplied by what
   the cycle costs over the median of what was given, so that money counts where it is known and
   a loop without a figure stands as one that costs as much as most.

*Confidence* in a friction that was found is the product of: how well its size is known (1 for a
point, .5 for an interval as wide as twice its middle), how often it was seen (n/(n + 3) for a stem
that turned back n times, as a friction shows when the stem turns), how much of the record speaks
for it (.3 where it gains no more than a friction must to be believed, 17 as −2 log likelihood, and
from there to 1 with b/(b + 17), b what it gains beyond), whether the closed loop agrees (1 where it
says the valve is the cause, .8 where it does not tell, .6 where it names another one), whether its
rates speak of processes that the controller would hold (1, else .6), and the share of the rates and
halves of the record that agree.

A valve that is *undecided* shows friction, and something speaks against believing it. Its
confidence is .3 at most, where that of those that were found begins: times g/(g + 17), with g the
gain at the rate at which it is most, whether the closed loop agrees, and (1 + h)/2, with h the
share of the movement that goes away without the friction. That the same is seen at a second rate
and in both halves, as a verdict asks, keeps wrong ones out of what is found; here it tells little.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.identification.closed_loop.explanation import MANY_TIMES
from stiction_ros.identification.evidence.rates import PRICE
from stiction_ros.survey.entry import Entry, Status

AGREES = {"valve": 1.0, "none": 0.8, "unknown": 0.8}
"""Factor by the cause that the closed loop names; for the others :data:`DISAGREES`."""

DISAGREES = 0.6

NOT_HELD = 0.6
"""Factor where a rate speaks of a process that the controller would not hold: of the frictions that
were found so in the field (seeds 0:399, 11000:11619) 19 of 25 are true, else 327 of 342."""

OPEN = 0.3
"""Confidence in a verdict that is open, at most, and where that in a friction begins."""

HEALTHY = 0.9
"""Confidence in a healthy valve: friction that never had to slip is not seen."""

HALF_SEEN = 3.0
"""Reversals of the stem from which a friction is half believed."""


def confidence(valve: Mapping[str, Any], cause: str | None, reversals: int) -> float:
    """Return the confidence in a verdict, 0 to 1.

    Args:
        valve: entry of ``valves`` of ``identify --json``.
        cause: of the oscillation of its output.
        reversals: of the estimated stem in the record.
    """
    agrees = AGREES.get(cause or "unknown", DISAGREES)
    if valve["verdict"] == "undecided":
        return OPEN * _shown(valve) * agrees
    stability = valve.get("stability")
    steady = len(stability["agreed"]) / len(stability["tried"]) if stability else 1.0
    if valve["verdict"] == "healthy":
        return HEALTHY * steady
    low, high = valve["f_s_interval"]
    known = 1.0 / (1.0 + (high - low) / max(high + low, 1e-12))
    seen = reversals / (reversals + HALF_SEEN)
    held = 1.0 if valve.get("evidence", {}).get("held", 1.0) else NOT_HELD
    return float(known) * seen * _sure(valve) * agrees * held * steady


def _shown(valve: Mapping[str, Any]) -> float:
    """Return how much speaks for the friction of an undecided valve, 0 to 1."""
    told = valve.get("evidence", {})
    gains = [gain for name, gain in told.items() if name.startswith("gain_")]
    repeats = told.get("moved_with", 0.0) < MANY_TIMES
    gone = min(told.get("loop_gone", 0.0), 1.0) if repeats else 0.0
    return _even_at_price(max([*gains, 0.0])) * (1.0 + gone) / 2.0


def _sure(valve: Mapping[str, Any]) -> float:
    """Return how much speaks for a friction that was found, :data:`OPEN` to 1; 1 if not told."""
    beyond = valve.get("evidence", {}).get("delta_bic")
    if beyond is None:
        return 1.0
    return OPEN + (1.0 - OPEN) * _even_at_price(max(float(beyond), 0.0))


def _even_at_price(gain: float) -> float:
    """Return a gain as a share, 0 to 1; :data:`PRICE`, which friction must gain, counts half."""
    return float(gain / (gain + PRICE))


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

    Args:
        entries: of all loops.
        costs: by name, money per hour for a |PV − SP| of one engineering unit.
    """
    priced = [
        dataclasses.replace(entry, cost_per_hour=_cost(entry, costs.get(entry.name)))
        for entry in entries
    ]
    known = [entry.cost_per_hour for entry in priced if entry.cost_per_hour]
    usual = float(np.median(known)) if known else 1.0

    def worth(entry: Entry) -> float:
        money = 1.0 if entry.cost_per_hour is None else entry.cost_per_hour / usual
        size = min(entry.band_share or 0.0, 1.0) if entry.found else 1.0
        return (entry.confidence or 0.0) ** 2 * size * money

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
