"""The parts of a record that has gaps: the longest good one, or all in one."""

import dataclasses
import datetime
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.records.record import Gap, Record

DATES = 3e8  # seconds from which a time is shown as a date: 1979
ALIKE = 0.01  # sample times of two parts, one over the other, that count as the same


def longest_part(parts: Sequence[Record]) -> Record:
    """Return the longest stretch of good samples, noting which it is; InputError without any."""
    good = [part for each in parts for part in each.good_parts()]
    if not good:
        raise InputError("has no good samples", where=parts[0].name)
    found = max(good, key=len)
    total = sum(len(part) for part in parts)
    if len(found) == total:
        return found
    others = len(good) - 1
    note = (
        f"only the longest good part is looked at: {span(found)}, {len(found)} of {total} "
        f"samples; {1 - len(found) / total:.1%} of the samples, in {others} other good "
        f"part{'s' * (others != 1)} or not good, are left out"
    )
    return dataclasses.replace(found, notes=(*found.notes, note))


def span(*parts: Record) -> str:
    """Return from when to when parts of one clock reach: ``5 s to 20 s``, or dates in UTC."""
    first, last = parts[0], parts[-1]
    return f"{_moment(first.start)} to {_moment(last.start + float(last.time[-1]))}"


def joined(parts: Sequence[Record]) -> Record:
    """Return the parts of one source, one at least, as one record with gaps between them.

    It has the sample time of the longest part; parts with another one, and signals that are
    not in every part, are left out with a note.
    """
    if len(parts) == 1:
        return parts[0]
    model = max(parts, key=len)
    kept = [part for part in parts if abs(part.sample_time / model.sample_time - 1.0) <= ALIKE]
    notes = list(dict.fromkeys(note for part in kept for note in part.notes))
    if len(kept) < len(parts):
        other = len(parts) - len(kept)
        notes.append(
            f"{other} part{'s' * (other > 1)} with another sample time than "
            f"{model.sample_time:g} s left out"
        )
    ends = np.cumsum([len(part) for part in kept]).tolist()
    signals: dict[str, Any] = {"sp": None, "stem": None}
    for key in dict.fromkeys(key for part in kept for key in part.signals):
        if all(key in part.signals for part in kept):
            signals[key] = np.concatenate([part.signals[key] for part in kept])
        else:
            notes.append(f"{key} is not known in every part, left out")
    return dataclasses.replace(
        model,
        **signals,
        start=kept[0].start,
        notes=tuple(notes),
        mask=np.concatenate([part.quality for part in kept]),
        gaps=tuple(Gap(row, part.start) for row, part in zip(ends, kept[1:], strict=False)),
    )


def _moment(seconds: float) -> str:
    if not DATES < seconds < 2 * 10**9:
        return f"{seconds:.9g} s"
    moment = datetime.datetime.fromtimestamp(round(seconds, 3), datetime.UTC)
    return moment.replace(tzinfo=None).isoformat(" ")[:23]
