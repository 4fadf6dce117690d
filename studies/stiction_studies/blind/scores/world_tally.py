"""Rates over many loops of the field with something hidden in them."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_studies.blind.scores.tally import Rate, matrix
from stiction_studies.blind.scores.world_scores import WorldScore

TESTABLE = 20.0
"""Gain in ln L of the oracle, over no effect and all rivals, from which a name is expected."""

PLAIN = 100.0
"""Gain over no effect from which something has to be found."""


def rates(rows: Sequence[WorldScore]) -> list[Rate]:
    """Return the rates that the workflow is held to, of one family and one kind of model."""
    hidden = [row for row in rows if not row.healthy]
    healthy = [row for row in rows if row.healthy]
    testable = [row for row in hidden if row.gain() >= TESTABLE]
    plain = [row for row in hidden if row.gain_over_none() >= PLAIN]
    exact = all(row.given == "exact" for row in rows)
    two = any(row.family == "two" for row in rows)
    wrong = 0.02 if two else 0.015 if exact else 0.03
    right = 0.92 if rows and rows[0].family == "physics" else 0.9 if exact and not two else 0.8
    return [
        _rate("named what is not there", [bool(r.wrong) for r in rows], f"<= {wrong:g}"),
        _rate("healthy: false alarm", [r.alarm for r in healthy], "<= 0.015"),
        _rate("healthy: unknown", [_unknown(r) for r in healthy]),
        _rate(f"oracle gains {TESTABLE:g}", [r.gain() >= TESTABLE for r in hidden]),
        _rate("right of those", [r.right for r in testable], f">= {right:g}"),
        _rate(f"none, oracle gains {PLAIN:g}", [r.silent for r in plain], "0"),
        _rate("unknown, of those too", [_unknown(r) for r in plain]),
        Rate("sets in doubt that hold a truth", _sum(rows, "held"), _sum(rows, "sets"), ">= 0.97"),
        *_coverage(rows),
    ]


def report(rows: Sequence[WorldScore]) -> dict[str, Any]:
    """Return everything as the JSON mapping."""
    parts = {
        f"{family}, {given}": [r for r in rows if r.family == family and r.given == given]
        for family, given in dict.fromkeys((r.family, r.given) for r in rows)
    }
    return {
        "loops": len(rows),
        "parts": {name: _part(part) for name, part in parts.items()},
        "rows": [row.to_mapping() for row in rows],
    }


def median_closed(rows: Sequence[WorldScore]) -> float:
    """Return the median share of the held-out excess that right answers close; NaN of none."""
    shares = [r.closed for r in rows if r.right and not math.isnan(r.closed)]
    return float(np.median(shares)) if shares else math.nan


def seconds(rows: Sequence[WorldScore]) -> tuple[float, float]:
    """Return median and largest processor time of the workflow."""
    times = [row.seconds for row in rows]
    return float(np.median(times)), float(np.max(times))


def _part(rows: Sequence[WorldScore]) -> dict[str, Any]:
    middle, largest = seconds(rows)
    closed = median_closed(rows)
    return {
        "rates": [dataclasses.asdict(rate) | {"share": rate.share} for rate in rates(rows)],
        "closed_median": closed,
        "seconds_median": middle,
        "seconds_max": largest,
        "matrix": {cause: dict(said) for cause, said in matrix(rows).items()},
    }


def _rate(name: str, flags: Sequence[bool], wanted: str = "") -> Rate:
    return Rate(name, sum(flags), len(flags), wanted)


def _unknown(row: WorldScore) -> bool:
    return str(row.answer["verdict"]) == "unknown"


def _sum(rows: Sequence[WorldScore], key: str) -> int:
    return sum(int(getattr(row, key)) for row in rows)


def _coverage(rows: Sequence[WorldScore]) -> list[Rate]:
    counts: dict[str, list[bool]] = {}
    for row in rows:
        for key, holds in row.covered.items():
            counts.setdefault(key, []).append(holds)
    every = [holds for values in counts.values() for holds in values]
    whole = _rate("intervals that hold the truth", every, ">= 0.9")
    return [whole, *(_rate(f"interval {key}", v) for key, v in sorted(counts.items()))]
