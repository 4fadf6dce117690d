"""Stretches of a record without a gap in time."""

from __future__ import annotations

from typing import NamedTuple


class Gap(NamedTuple):
    """Where a record goes on after a gap, or where another run begins.

    Attributes:
        row: first sample behind it.
        start: time of that sample on the record's own clock, s.
    """

    row: int
    start: float


class Segment(NamedTuple):
    """A stretch of samples without a gap.

    Attributes:
        first, last: its samples, ``last`` not included.
        start: time of the first on the record's own clock, s.
    """

    first: int
    last: int
    start: float
