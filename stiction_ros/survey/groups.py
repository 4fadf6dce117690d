"""Loops that cycle together, the likely source first.

A valve that makes its own loop cycle moves what lies around it at its period, so its loop comes
first; then one that rings by its tuning; last what only bears a wave. The more regular is nearer.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.records.parts import DATES
from stiction_ros.survey.beats import ALIKE, locked
from stiction_ros.survey.entry import Entry

NEARNESS = {"valve": 0, "tuning": 1, "unknown": 2, "none": 2, "disturbance": 3, "set_point": 4}
"""Place of a cause in the search for a source."""


@dataclasses.dataclass(frozen=True)
class Group:
    """Loops that cycle together."""

    number: int  # from 1
    period: float  # s, the median
    names: tuple[str, ...]  # of the loops, the likely source first


def grouped(entries: Sequence[Entry]) -> tuple[list[Entry], list[Group]]:
    """Return the entries with the numbers of their groups, and the groups."""
    times = [np.array(entry.beats) for entry in entries]
    # What two loops must share for their times to compare: dates, else their files.
    clocks = ["dates" if e.beats and e.beats[0] > DATES else e.files for e in entries]
    turns = [float(np.median(np.diff(each))) if len(each) > 1 else 0.0 for each in times]
    cycling = sorted((k for k, turn in enumerate(turns) if turn > 0.0), key=turns.__getitem__)
    parent = list(range(len(entries)))

    def root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = parent[k]
        return k

    for place, one in enumerate(cycling):
        for other in cycling[place + 1 :]:
            if math.log(turns[other] / turns[one]) > ALIKE:
                break
            if root(one) == root(other) or clocks[one] != clocks[other]:
                continue
            if locked(times[one], times[other]):
                parent[root(other)] = root(one)
    members: dict[int, list[int]] = {}
    for k in cycling:
        members.setdefault(root(k), []).append(k)
    found = [rows for rows in members.values() if len(rows) > 1]
    found.sort(key=lambda rows: (-len(rows), entries[rows[0]].name))
    numbered, groups = list(entries), []
    for number, rows in enumerate(found, start=1):
        ordered = sorted((entries[k] for k in rows), key=_nearness)
        period = float(np.median([_period(entry) for entry in ordered]))
        groups.append(Group(number, period, tuple(entry.name for entry in ordered)))
        for k in rows:
            numbered[k] = dataclasses.replace(numbered[k], group=number)
    return numbered, groups


def _period(entry: Entry) -> float:
    return 0.0 if entry.oscillation is None else entry.oscillation.period or 0.0


def _nearness(entry: Entry) -> tuple[int, float, float, str]:
    regular = 0.0 if entry.oscillation is None else entry.oscillation.regularity
    place = NEARNESS.get(entry.cause or "none", len(NEARNESS))
    return place, -(entry.probability or 0.0), -regular, entry.name
