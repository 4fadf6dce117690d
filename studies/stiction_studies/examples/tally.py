"""Many seeds in a few sentences: how often an identification was right."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from stiction_ros.identification import VerdictKind
from stiction_studies.examples.comparison import Comparison

FRICTION_TOLERANCE = {"example1": 0.1, "example2": 0.15}
HEALTHY_FRICTION = 0.3


@dataclasses.dataclass(frozen=True)
class Finding:
    """How many of the seeds have a property.

    Attributes:
        text: the property.
        count, total: seeds that have it, and all.
        wanted: share that is asked for, or None; ``at_most`` turns it round.
    """

    text: str
    count: int
    total: int
    wanted: float | None = None
    at_most: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the share that is asked for is reached; None when none is asked for."""
        if self.wanted is None:
            return None
        share = self.count / self.total
        return share <= self.wanted if self.at_most else share >= self.wanted

    def __str__(self) -> str:
        """Return ``TEXT: COUNT of TOTAL`` and what is asked for."""
        line = f"{self.text}: {self.count} of {self.total}"
        if self.wanted is None:
            return line
        asked = f"{'at most' if self.at_most else 'wanted'} {100 * self.wanted:g} %"
        return f"{line} ({asked}: {'met' if self.met else 'not met'})"

    def to_dict(self) -> dict[str, Any]:
        """Return JSON data."""
        return dataclasses.asdict(self) | {"met": self.met}


def tally(name: str, comparisons: Sequence[Comparison]) -> tuple[Finding, ...]:
    """Return the findings on one example over many seeds.

    Args:
        name: ``example1``, ``example2`` or ``healthy``.
        comparisons: one per seed, at least one.
    """
    return _TALLIES[name](comparisons)


def _example1(comparisons: Sequence[Comparison]) -> tuple[Finding, ...]:
    total = len(comparisons)
    reach = FRICTION_TOLERANCE["example1"]
    delays = sum(all(c.delay.error == 0 for c in comp.channels) for comp in comparisons)
    return (
        Finding("delay right", delays, total, 0.99),
        Finding(
            f"|f_S − 5| ≤ {reach} and |f_D − 2| ≤ {reach}",
            sum(_close(comp, 0, reach) for comp in comparisons),
            total,
            0.95,
        ),
        *_intervals(comparisons, 0),
        _verdicts(comparisons, 0, VerdictKind.STICKY),
    )


def _example2(comparisons: Sequence[Comparison]) -> tuple[Finding, ...]:
    total = len(comparisons)
    reach = FRICTION_TOLERANCE["example2"]
    low = sum(c.valves[1].static_friction.found <= HEALTHY_FRICTION for c in comparisons)
    return (
        Finding(
            f"V1: |f_S − 8| ≤ {reach} and |f_D − 1| ≤ {reach}",
            sum(_close(comp, 0, reach) for comp in comparisons),
            total,
            1.0,
        ),
        Finding(f"V2: f_S ≤ {HEALTHY_FRICTION}", low, total, 1.0),
        dataclasses.replace(_verdicts(comparisons, 1, VerdictKind.HEALTHY), wanted=1.0),
        *(dataclasses.replace(f, wanted=None) for f in _intervals(comparisons, 0)),
        _verdicts(comparisons, 0, VerdictKind.STICKY),
    )


def _healthy(comparisons: Sequence[Comparison]) -> tuple[Finding, ...]:
    found = [_verdicts(comparisons, 0, kind) for kind in VerdictKind]
    with_friction = sum(VerdictKind(c.valves[0].verdict).has_friction for c in comparisons)
    name = comparisons[0].valves[0].name
    found.append(Finding(f"{name}: sticky or backlash", with_friction, len(comparisons)))
    return tuple(
        dataclasses.replace(f, wanted=0.02, at_most=True) if "sticky" in f.text else f
        for f in found
    )


def _close(comparison: Comparison, valve: int, reach: float) -> bool:
    found = comparison.valves[valve]
    errors = (found.static_friction.error, found.dynamic_friction.error)
    return all(abs(error) <= reach + 1e-12 for error in errors)


def _intervals(comparisons: Sequence[Comparison], valve: int) -> tuple[Finding, ...]:
    total = len(comparisons)
    name = comparisons[0].valves[valve].name
    static = sum(bool(c.valves[valve].static_friction.inside) for c in comparisons)
    dynamic = sum(bool(c.valves[valve].dynamic_friction.inside) for c in comparisons)
    return (
        Finding(f"{name}: true f_S in its own interval", static, total, 0.9),
        Finding(f"{name}: true f_D in its own interval", dynamic, total, 0.9),
    )


def _verdicts(comparisons: Sequence[Comparison], valve: int, kind: VerdictKind) -> Finding:
    name = comparisons[0].valves[valve].name
    count = sum(c.valves[valve].verdict == kind.value for c in comparisons)
    return Finding(f"{name}: {kind.value}", count, len(comparisons))


_TALLIES: Mapping[str, Callable[[Sequence[Comparison]], tuple[Finding, ...]]] = {
    "example1": _example1,
    "example2": _example2,
    "healthy": _healthy,
}
