"""Long records without a model: only their liveliest part is looked at, and that is said."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.records import Record

MOST = 5000  # samples of all records together
PLACES = 9  # where a part may begin


def liveliest_parts(records: Sequence[Record], most: int = MOST) -> tuple[Record, ...]:
    """Return the records, cut where they have more than ``most`` samples together.

    Every record keeps the same share, the part in which OP moves most. Times are then those
    since the first sample of the part; a note says which samples it holds.
    """
    total = sum(len(record) for record in records)
    if total <= most:
        return tuple(records)
    return tuple(_cut(record, max(len(record) * most // total, 1)) for record in records)


def _cut(record: Record, count: int) -> Record:
    begins = np.unique(np.linspace(0, len(record) - count, PLACES).astype(int)).tolist()
    span = np.maximum(record.op.std(axis=0), 1e-300)
    moved = [float((record.op[a : a + count] / span).std(axis=0).sum()) for a in begins]
    first = begins[int(np.argmax(moved))]
    note = (
        f"{record.name} is long: samples {first} to {first + count - 1}, in which OP moves most, "
        "were looked at"
    )
    part = record.part(first, first + count)
    return dataclasses.replace(part, notes=(*record.notes, note))
