"""Which loops cycle together, and in which order they are serviced.

Two loops cycle together where their cycles begin at one phase of each other. In a group the likely
source comes first: a valve that makes its own loop cycle moves what lies around it at its period;
then a loop that rings by its tuning; last what only bears a wave. The more regular is nearer.

The order of service:

1. *Kind*: valves found that make their loop cycle; those found whose cycle has another cause;
   undecided valves; healthy valves in loops that cycle; the rest; what was not judged.
2. Among one kind *P × what a service would bring*: the probability of friction by the share of the
   loop's movement that goes away without the friction, simulated; where a cost was given it
   is multiplied by what the cycle costs over the median of what was given.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.parts import DATES
from stiction_ros.signals.oscillation import moving, size, turnings
from stiction_ros.survey.entry import Entry, Status

NEARNESS = {"valve": 0, "tuning": 1, "unknown": 2, "none": 2, "disturbance": 3, "set_point": 4}
"""Place of a cause in the search for a source."""
MOST = 200  # beats that are kept of a record, the last ones
FEWEST = 5  # beats of one loop from which two can be compared
ALIKE = 0.05  # logarithm of the ratio of two periods up to which they may be the same

LOCKED = 0.85
"""Mean resultant length of the phases from which on two loops keep the same time: 1 is to the
sample; two cycles of their own that part by half a turn within the record come to .64."""


def beats(error: FloatArray, period: float) -> FloatArray:
    """Return the samples, not whole, at which PV − SP, (N,), sets out upwards through its mean."""
    moved = moving(error, period)
    rows = []
    for k in turnings(moved, 0.3 * size(moved)).tolist():
        if moved[k] > 0.0:
            a = int(np.flatnonzero(moved[:k] <= 0.0)[-1])
            rows.append(a + float(moved[a] / (moved[a] - moved[a + 1])))
    return np.array(rows[-MOST:])


def locked(one: FloatArray, other: FloatArray) -> bool:
    """Tell whether two loops' beats, s on one clock, keep the same time: one begins at one phase.

    References:
        K. V. Mardia, P. E. Jupp: Directional Statistics, Wiley 2000, section 2.3.
    """
    if min(len(one), len(other)) < 2:
        return False
    periods = [float(np.median(np.diff(each))) for each in (one, other)]
    if min(periods) <= 0.0 or abs(np.log(periods[0] / periods[1])) > ALIKE:
        return False
    inside = one[(one >= other[0]) & (one <= other[-1])]
    if len(inside) < FEWEST:
        return False
    phase = np.interp(inside, other, np.arange(len(other), dtype=float))
    return bool(np.abs(np.mean(np.exp(2j * np.pi * phase))) >= LOCKED)


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
    group = np.arange(len(entries))
    for place, one in enumerate(cycling):
        for other in cycling[place + 1 :]:
            if math.log(turns[other] / turns[one]) > ALIKE:
                break
            if group[one] == group[other] or clocks[one] != clocks[other]:
                continue
            if locked(times[one], times[other]):
                group[group == group[other]] = group[one]
    members: dict[int, list[int]] = {}
    for k in cycling:
        members.setdefault(int(group[k]), []).append(k)
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

    The ``costs`` by name are money per hour for a |PV − SP| of one engineering unit.
    """
    priced = [
        dataclasses.replace(entry, cost_per_hour=_cost(entry, costs.get(entry.name)))
        for entry in entries
    ]
    known = [entry.cost_per_hour for entry in priced if entry.cost_per_hour]
    usual = float(np.median(known)) if known else 1.0

    def worth(entry: Entry) -> float:
        money = 1.0 if entry.cost_per_hour is None else entry.cost_per_hour / usual
        gone = min(max(entry.evidence.get("loop_gone", 0.0), 0.0), 1.0) if entry.found else 1.0
        return (entry.probability or 0.0) * gone * money

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
