"""Δu: the span of the sustained oscillation of OP, to which Section 3.2 limits friction.

A record is cut where a set-point moves, else into eight parts. Of each hold the second half counts.
Δu is the largest span that another one reaches by half: what comes once is a transient.
"""

import dataclasses
import itertools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records import Record
from stiction_ros.signals.holds import holds

SETTLED = 0.5  # share of a hold after which OP has settled
REPEATED = 0.5  # of the larger of two spans that come from the same cycle
ALIKE = 0.9
PARTS = 8
MIN_SAMPLES = 4  # of a part that is looked at


@dataclasses.dataclass(frozen=True)
class SustainedOscillation:
    """Δu of one valve and what speaks for it."""

    valve: str  # tag
    span: float  # Δu, %
    sustained: bool  # whether another part repeats it; False where the span of OP stands in
    whole: float  # span of OP over the record, %
    parts: tuple[tuple[int, int], ...]  # first row and one past the last of every part looked at
    spans: tuple[float, ...]  # of OP in each part, %

    @property
    def alike(self) -> int:
        """Number of parts whose span is Δu within a tenth."""
        return sum(ALIKE * self.span <= span <= self.span for span in self.spans)

    def __str__(self) -> str:
        """Return the evidence in one line."""
        if not self.sustained:
            return f"Δu of {self.valve} {self.span:.3g} %: no oscillation repeats, OP's whole span"
        return (
            f"Δu of {self.valve} {self.span:.3g} %, within a tenth in {self.alike} of "
            f"{len(self.spans)} parts; OP spans {self.whole:.3g} %"
        )


def sustained_oscillations(record: Record) -> tuple[SustainedOscillation, ...]:
    """Return Δu of every valve of a record, with its evidence."""
    parts = _parts(record)
    return tuple(
        _of_valve(tag, op, parts) for tag, op in zip(record.valves, record.op.T, strict=True)
    )


def _parts(record: Record) -> tuple[tuple[int, int], ...]:
    """Return the settled half of every hold, or equal parts where no set-point moves."""
    rows = [] if record.sp is None else holds(record.sp)
    if len(rows) < 2:
        edges = np.linspace(0, len(record), PARTS + 1).astype(int).tolist()
        rows = list(itertools.pairwise(edges))
    else:
        rows = [(begin + int(SETTLED * (end - begin)), end) for begin, end in rows]
    return tuple((begin, end) for begin, end in rows if end - begin >= MIN_SAMPLES)


def _of_valve(tag: str, op: FloatArray, parts: tuple[tuple[int, int], ...]) -> SustainedOscillation:
    spans = tuple(float(np.ptp(op[begin:end])) for begin, end in parts)
    ordered = sorted(spans, reverse=True)
    repeated = [
        large for large, small in itertools.pairwise(ordered) if small >= REPEATED * large > 0.0
    ]
    whole = float(np.ptp(op))
    span = repeated[0] if repeated else whole
    return SustainedOscillation(tag, span, bool(repeated), whole, parts, spans)
