"""Loops that share a plant: which valve makes them cycle, and whom it disturbs.

Each loop is judged as a survey judges it, and the groups of the survey say who cycles together and
who is the likely source. A wave from a neighbour may look like friction of the own valve. So where
several valves of a group seem to stick, each PV is explained once more by all of these valves: the
OP of a neighbour tells its stem, and the own valve is only found to stick if it is still needed.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.identification import identify
from stiction_ros.intake.loop import Loop
from stiction_ros.loop.member_loops import is_set_point
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record
from stiction_ros.survey.assess import assess
from stiction_ros.survey.entry import Entry, SurveyOptions
from stiction_ros.survey.groups import Group, grouped


@dataclasses.dataclass(frozen=True)
class Disturbed:
    """A loop that cycles with a valve of another one."""

    name: str  # of the loop
    by: str  # name of the loop whose valve it is
    period: float  # of the group, s
    # s from the beginning of a cycle of the source to that of this loop, at most half a period
    # either way; negative where this loop begins first
    behind: float
    alone: str = ""  # what was found of its valve by its own signals; empty where no friction was

    @property
    def timing(self) -> str:
        """How its cycle stands to that of the source, in words."""
        side = "after" if self.behind > 0.0 else "before"
        return (
            f"it keeps the period of {self.period:.0f} s, and its cycles begin "
            f"{abs(self.behind):.0f} s {side} those of {self.by}"
        ) + (f"; by its own signals its valve seems {self.alone}" if self.alone else "")


@dataclasses.dataclass(frozen=True)
class Neighbours:
    """What is said of the loops of one plant."""

    entries: Mapping[str, Entry]  # of the survey, by the name of the loop
    groups: tuple[Group, ...]  # of the survey: loops that cycle together, the likely source first
    sources: Mapping[str, str]  # valves to service, by the name of their loop
    disturbed: tuple[Disturbed, ...]  # loops whose cycle comes from one of these valves

    @property
    def sentences(self) -> list[str]:
        """What to do, and what becomes of whom; one sentence each."""
        said = []
        for loop, valve in self.sources.items():
            others = [one for one in self.disturbed if one.by == loop]
            together = f"{1 + len(others)} loops stop" if others else f"{loop} stops"
            said.append(f"Service {valve} and {together} cycling.")
            gone = self.entries[loop].evidence.get("loop_gone", 0.0)
            said.append(
                f"{loop}: {valve} sticks, and without its friction {100 * min(gone, 1.0):.0f} % of "
                "the movement goes away."
            )
            said += [f"{one.name}: disturbed by {loop}; {one.timing}." for one in others]
        return said or ["No valve is shown to make these loops cycle."]

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping for JSON."""
        return {
            "sources": dict(self.sources),
            "disturbed": [dataclasses.asdict(one) for one in self.disturbed],
            "groups": [dataclasses.asdict(group) for group in self.groups],
            "loops": [entry.to_dict() for entry in self.entries.values()],
            "sentences": self.sentences,
        }


def neighbours(records: Mapping[str, Record]) -> Neighbours:
    """Judge the loops of one plant by records of one stretch of time; tell who disturbs whom."""
    plain = SurveyOptions(gain=False, pages=False)
    alone = {n: assess(Loop(n, (), (record,)), plain).entry for n, record in records.items()}
    by_name = dict(alone)
    for group in grouped(list(alone.values()))[1]:
        stuck = [n for n in group.names if alone[n].found and not is_outer(records[n])]
        for name in stuck if len(stuck) > 1 else ():
            beside = [records[other] for other in stuck if other != name]
            by_name[name] = _judged_beside(alone[name], records[name], beside)
    entries, groups = grouped(list(by_name.values()))
    by_name = {entry.name: entry for entry in entries}
    sources = {
        entry.name: ", ".join(records[entry.name].valves)
        for entry in entries
        if entry.found and entry.cause == "valve" and not is_outer(records[entry.name])
    }
    disturbed = []
    for group in groups:
        source = next((name for name in group.names if name in sources), "")
        disturbed += [
            Disturbed(
                name,
                source,
                group.period,
                _behind(by_name[source], by_name[name]),
                "" if by_name[name].found or not alone[name].found else str(alone[name].verdict),
            )
            for name in group.names
            if source and name not in sources
        ]
    return Neighbours(by_name, tuple(groups), sources, tuple(disturbed))


def is_outer(record: Record) -> bool:
    """Tell whether a loop moves set-points alone: a friction behind these is of an inner loop."""
    return all(map(is_set_point, record.valves))


def _judged_beside(entry: Entry, own: Record, others: Sequence[Record]) -> Entry:
    """Return the entry of a loop whose PV valves of other loops may explain as well."""
    rows = [record.filled() for record in (own, *others)]
    begin = max(record.start for record in rows)
    first = [round((begin - record.start) / own.sample_time) for record in rows]
    count = min(len(record) - k for record, k in zip(rows, first, strict=True))
    rows = [record.part(k, k + count) for record, k in zip(rows, first, strict=True)]
    joint = dataclasses.replace(
        rows[0],
        valves=tuple(valve for record in rows for valve in record.valves),
        op=np.hstack([record.op for record in rows]),
        stem=None,
        mask=np.max([record.quality for record in rows], axis=0),
    )
    found = identify(longest_part((joint,))).valves[: len(own.valves)]
    if any(valve.verdict.has_friction for valve in found):
        return entry
    one = max(found, key=lambda valve: valve.probability or 0.0)
    told = dataclasses.replace(entry, verdict=one.verdict.value, probability=one.probability)
    return dataclasses.replace(told, cause="disturbance", evidence=one.evidence)


def _behind(source: Entry, other: Entry) -> float:
    """Return by how much the cycles of a loop begin after those of the source, s."""
    ours, theirs = np.array(source.beats), np.array(other.beats)
    inside = theirs[(theirs >= ours[0]) & (theirs <= ours[-1])]
    turns = np.interp(inside, ours, np.arange(len(ours), dtype=float))
    phase = float(np.angle(np.mean(np.exp(2j * np.pi * turns))) / (2.0 * np.pi))
    return phase * float(np.median(np.diff(ours)))
