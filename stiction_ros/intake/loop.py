"""One loop of a plant, as it was found in exports."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from stiction_ros.records.record import Record


@dataclasses.dataclass(frozen=True)
class Loop:
    """A named loop with its records, or the reason why there are none.

    Attributes:
        name: of the loop: its tag, or the name of its file.
        files: that it was read from.
        parts: its records, one for each stretch without a gap, in their order; a sample's
            quality says what was held, bad or in manual. Empty when there is a problem.
        notes: what was masked, held, cut, converted, with its count, one sentence each; the
            records bear the same.
        problem: why it cannot be read and what helps, one sentence; None when it can be.
    """

    name: str
    files: tuple[Path, ...]
    parts: tuple[Record, ...]
    notes: tuple[str, ...] = ()
    problem: str | None = None
