"""The columns of the list: heading, what it means, and the cells of a loop."""

import functools
import html
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from stiction_ros.pages.frame import text
from stiction_ros.pages.plot import spark
from stiction_ros.survey.entry import Entry
from stiction_ros.survey.listing.headline import (
    HEADS,
    Earlier,
    change,
    in_words,
    kind_of,
    note_of,
    steps_of,
)
from stiction_ros.survey.pages import words as say
from stiction_ros.texts import probability, spoken

Cell = tuple[str, object]  # HTML, and what it is sorted by; None stands last

COST = "cost per hour"
SAVED = {
    "service": "change of the mean |PV − SP| by a service of the valve, simulated: −75 % leaves a "
    "quarter of it",
    "embedding": "the same by a controller that knows the friction",
    "retune": "the same by another tuning of the controller",
}
"""What the heading of each thing that may be done means."""


class Column(NamedTuple):
    """One column of the list."""

    head: str
    kind: str  # classes of its cells
    hint: str  # what its heading means
    cell: Callable[[Entry], Cell]  # of a loop; empty HTML where there is nothing to say

    def shown(self, entry: Entry) -> tuple[str, str]:
        """Return what the column shows of a loop, a dash for nothing, and what it is sorted by."""
        found, value = self.cell(entry)
        plain = "" if value is None else f"{value:.9g}" if isinstance(value, float) else str(value)
        return found or "–", plain

    def words(self, entry: Entry) -> str:
        """Return what the column tells of a loop in plain words; nothing where it is empty."""
        return html.unescape(re.sub("<[^>]*>", "", self.cell(entry)[0]))


def columns_of(entries: Sequence[Entry], earlier: Sequence[Earlier]) -> list[Column]:
    """Return the columns of a list with earlier surveys, the oldest first."""
    found = [
        Column(
            *("rank", "up", "the order in which to service the valves"),
            lambda entry: (text(entry.rank or ""), entry.rank),
        ),
        Column("loop", "t name", "the tag of the loop, or the name of its file", _name),
        Column("valve", "t s", "what was found of the valve, or how far the loop came", _valve),
        Column(
            *("cycles by", "t", "what makes the loop cycle"),
            lambda entry: (text(say.cause_words(entry.cause)), say.cause_words(entry.cause)),
        ),
        Column(
            *("OP lost", "s"),
            "share of OP's movement that does not reach the stem: the band f_S + f_D",
            lambda entry: (say.percent(entry.band_share) if entry.found else "", entry.band_share),
        ),
        Column(
            *("friction f_S", "s"),
            "static friction in % of travel, or in the units of an OP that has its own",
            _friction,
        ),
        Column(
            *("probability", "", "of friction in the valve"),
            lambda entry: (probability(entry.probability), entry.probability),
        ),
        Column(
            *("worth a test", "s"),
            "what a test in manual would take, where the record does not decide: its time, and how "
            "far PV is expected to move (stiction valve-test plan)",
            _test,
        ),
        Column("period", "s", "of the cycle of PV − SP", _period),
        Column("amplitude, PV units", "", "of the cycle of PV − SP", _amplitude),
    ]
    if any(entry.gain for entry in entries):
        for what, head in HEADS.items():
            found.append(Column(head, "", SAVED[what], functools.partial(_saved, what=what)))
    if any(entry.cost_per_hour is not None for entry in entries):
        found.append(
            Column(
                *(COST, "", "what the cycle costs in an hour"),
                lambda entry: (say.figure(entry.cost_per_hour), entry.cost_per_hour),
            )
        )
    if earlier:
        found.append(
            Column(
                *("friction before and now", "trend"),
                "f_S + f_D in the first survey and now; lines are drawn from 0 to the widest band",
                _trends(entries, earlier),
            )
        )
    return [
        *found,
        Column(
            *("group", "up", "loops with the same number cycle together"),
            lambda entry: (text(entry.group or ""), entry.group),
        ),
        Column(
            *("why not judged", "t wordy", "the reason, and what to do about it"),
            lambda entry: (text(entry.reason), entry.reason),
        ),
    ]


def _name(entry: Entry) -> Cell:
    name = "<wbr>".join(text(part) for part in re.split(r"(?<=[_.:/])", entry.name))
    shown = f'<a href="{text(entry.report)}">{name}</a>' if entry.report else name
    return shown, entry.name


def _valve(entry: Entry) -> Cell:
    kind = kind_of(entry)
    return f'<span class="{kind}">{text(kind)}</span>', kind


def _friction(entry: Entry) -> Cell:
    if not entry.found:
        return "", None
    between, shown = say.interval(entry.f_s_interval), say.op_figure(entry.f_s, entry.op_unit)
    return f'<span title="{text(between)}">{text(shown)}</span>', entry.f_s


def _test(entry: Entry) -> Cell:
    if entry.test is None:
        return "", None
    time, move = entry.test["duration"], entry.test["pv_move"]
    return text(f"{spoken(time)}{'' if move is None else f', PV ±{say.figure(move)}'}"), time


def _period(entry: Entry) -> Cell:
    period = None if entry.oscillation is None else entry.oscillation.period
    return "" if period is None else spoken(period), period


def _amplitude(entry: Entry) -> Cell:
    amplitude = None if entry.oscillation is None else entry.oscillation.amplitude
    return say.figure(amplitude), amplitude


def _saved(entry: Entry, what: str) -> Cell:
    shown, note = in_words(entry, what), note_of(entry, what)
    if not shown:
        return "", None
    whole = text(shown).replace(" %", "&nbsp;%")
    return f'<span title="{text(note)}">{whole}</span>', change(entry, what)


def _trends(entries: Sequence[Entry], earlier: Sequence[Earlier]) -> Callable[[Entry], Cell]:
    """Return what shows the bands of a loop; lines of loops with one unit of OP have one scale."""
    steps = {entry.name: steps_of(entry, earlier) for entry in entries}
    widest: dict[str, float] = {}
    for entry in entries:
        bands = [band for _, band in steps[entry.name]]
        widest[entry.op_unit] = max([widest.get(entry.op_unit, 0.0), *bands])

    def cell(entry: Entry) -> Cell:
        told = steps[entry.name]
        if not told:
            return "", None
        first, last = told[0][1], told[-1][1]
        words = say.op_figure(last, entry.op_unit)
        words = words if len(told) == 1 else f"{say.figure(first)} → {words}"
        title = ", ".join(f"{day}: {say.figure(band)}" for day, band in told)
        line = spark([band for _, band in told], widest[entry.op_unit])
        return f'<span title="{text(title)}">{text(words)} {line}</span>', last - first

    return cell
