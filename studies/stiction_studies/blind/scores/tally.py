"""Rates over many blind loops, and the matrix of what was hidden and what was said."""

import dataclasses
import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_studies.blind.scores.scoring import Score, Scored
from stiction_studies.blind.scores.world_scores import WorldScore


@dataclasses.dataclass(frozen=True)
class Rate:
    """So many of so many; NaN of none.

    Attributes:
        name: what is counted.
        count, total: of loops.
        wanted: the limit, such as ``<= 0.03``.
    """

    name: str
    count: int
    total: int
    wanted: str = ""

    @property
    def share(self) -> float:
        """Return count / total."""
        return self.count / self.total if self.total else math.nan


def rates(rows: Sequence[Scored]) -> list[Rate]:
    """Return the rates of every family that occurs."""
    found: list[Rate] = []
    single = [row for row in rows if row.family == "single"]
    hidden = [row for row in single if row.cause != "none"]
    healthy = [row for row in single if row.cause == "none"]
    if single:
        testable = [row for row in hidden if row.testable]
        sets = [row for row in hidden if _ambiguous(row)]
        found += [
            _rate("wrong name", hidden, (Score.WRONG,), "<= 0.03"),
            _rate("false alarm, healthy", healthy, (Score.WRONG, Score.ALARM), "<= 0.02"),
            _rate("unknown, healthy", healthy, (Score.UNKNOWN,)),
            _rate("right among testable", testable, (Score.RIGHT,), ">= 0.85"),
            Rate("testable", len(testable), len(hidden)),
            Rate(
                "truth in the set of ambiguous", sum(_holds(r) for r in sets), len(sets), ">= 0.95"
            ),
        ]
        tight = [row for row in healthy if row.regime["tuning"] == "tight"]
        found.append(_rate("false alarm, tight", tight, (Score.WRONG, Score.ALARM), "<= 0.02"))
    two = [row for row in rows if row.family == "two"]
    if two:
        testable = [row for row in two if row.testable]
        found += [
            _rate("two: both among testable", testable, (Score.RIGHT,), ">= 0.6"),
            _rate("two: one among testable", testable, (Score.PART,)),
            _rate("two: a wrong one", two, (Score.WRONG,), "<= 0.05"),
        ]
    outside = [row for row in rows if row.family == "outside"]
    if outside:
        found += [
            _rate("outside: named", outside, (Score.WRONG,), "<= 0.1"),
            _rate("outside: a set", outside, (Score.ALARM,)),
            _rate("outside: unknown", outside, (Score.UNKNOWN,)),
        ]
    return found


def median_closed(rows: Sequence[Scored]) -> float:
    """Return the median share of the held-out excess that right names close; NaN of none."""
    shares = [r.closed for r in rows if r.score is Score.RIGHT and not math.isnan(r.closed)]
    return float(np.median(shares)) if shares else math.nan


def coverage(rows: Sequence[Scored]) -> list[Rate]:
    """Return how often intervals hold the truth: in all, then per effect and parameter."""
    counts: dict[str, list[bool]] = {}
    for row in rows:
        for key, holds in row.covered.items():
            counts.setdefault(key, []).append(holds)
    every = [holds for values in counts.values() for holds in values]
    whole = Rate("intervals", sum(every), len(every), ">= 0.9")
    return [whole, *(Rate(key, sum(v), len(v)) for key, v in sorted(counts.items()))]


def matrix(rows: Sequence[Scored | WorldScore]) -> dict[str, Counter[str]]:
    """Return, per cause, how often each thing was said."""
    found: dict[str, Counter[str]] = {}
    for row in sorted(rows, key=lambda row: row.cause):
        found.setdefault(row.cause, Counter())[row.said] += 1
    return found


def report(rows: Sequence[Scored]) -> dict[str, Any]:
    """Return everything as the JSON mapping."""
    every = [*rates(rows), *coverage(rows)]
    return {
        "loops": len(rows),
        "rates": [dataclasses.asdict(rate) | {"share": _number(rate.share)} for rate in every],
        "closed_median": _number(median_closed(rows)),
        "seconds_median": _number(
            float(np.median([r.seconds for r in rows])) if rows else math.nan
        ),
        "matrix": {cause: dict(said) for cause, said in matrix(rows).items()},
    }


def _rate(name: str, rows: Sequence[Scored], scores: tuple[Score, ...], wanted: str = "") -> Rate:
    return Rate(name, sum(row.score in scores for row in rows), len(rows), wanted)


def _ambiguous(row: Scored) -> bool:
    return "set" in row.said or "family" in row.said


def _holds(row: Scored) -> bool:
    return "set without it" not in row.said


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value
