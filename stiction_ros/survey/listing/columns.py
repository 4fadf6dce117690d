"""The columns of the list: heading, what it means, and the cells of a loop."""

import dataclasses
import re
from collections.abc import Callable, Mapping, Sequence

from stiction_ros.pages.frame import text
from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.listing.headline import HEADS, change, in_words, kind_of, note_of
from stiction_ros.survey.pages import words as say
from stiction_ros.survey.pages.trend import Earlier, Trend, trend_of, widest
from stiction_ros.texts import probability

TEST = "worth a test"
TREND = "friction before and now"

HINTS = {
    "rank": "the order in which to service the valves",
    "loop": "the tag of the loop, or the name of its file",
    "valve": "what was found of the valve, or how far the loop came",
    "cycles by": "what makes the loop cycle",
    "OP lost": "share of OP's movement that does not reach the stem: the band f_S + f_D",
    "friction f_S": "static friction in % of travel, or in the units of an OP that has its own",
    "probability": "of friction in the valve",
    TEST: "what a test in manual would take, where the record does not decide: its time, and how "
    "far PV is expected to move (stiction valve-test plan)",
    "period": "of the cycle of PV − SP",
    "amplitude, PV units": "of the cycle of PV − SP",
    HEADS["service"]: "change of the mean |PV − SP| by a service of the valve, simulated: −75 % "
    "leaves a quarter of it",
    HEADS["embedding"]: "the same by a controller that knows the friction",
    HEADS["retune"]: "the same by another tuning of the controller",
    "cost per hour": "what the cycle costs in an hour",
    TREND: "f_S + f_D in the first survey and now; lines are drawn from 0 to the widest band",
    "group": "loops with the same number cycle together",
    "why not judged": "the reason, and what to do about it",
}
"""What a heading means."""

NONE = {
    "cycles by": "It was not found what makes the loop cycle.",
    "probability": "This method computes no probability.",
    TEST: "No test is needed.",
    "period": "The loop does not cycle.",
    "amplitude, PV units": "The loop does not cycle.",
    "cost per hour": "No cost was given for this loop.",
    TREND: "No earlier survey has this loop.",
    "group": "The loop cycles with no other loop.",
    "why not judged": "The loop was judged.",
}
"""Why a cell of a loop that was judged is empty; the other cells are so without friction."""

Cell = tuple[str, object]  # HTML, and what it is sorted by; None stands last


@dataclasses.dataclass(frozen=True)
class Columns:
    """Which columns a list has."""

    costs: bool  # costs, gains: whether a loop has one
    gains: bool
    trends: Mapping[str, Trend]  # of the loops that an earlier survey has, by name
    earlier: bool  # whether there was an earlier survey
    widest: Mapping[str, float]  # end of the scale of the trends by unit of OP

    @classmethod
    def of(cls, entries: Sequence[Entry], earlier: Sequence[Earlier]) -> "Columns":
        """Return the columns of a list with earlier surveys, the oldest first."""
        found = {entry.name: trend_of(entry, earlier) for entry in entries}
        trends = {name: trend for name, trend in found.items() if trend is not None}
        units = {entry.op_unit for entry in entries}
        return cls(
            any(entry.cost_per_hour is not None for entry in entries),
            any(entry.gain for entry in entries),
            trends,
            bool(earlier),
            {unit: widest(trends.values(), unit) for unit in units},
        )

    @property
    def heads(self) -> list[tuple[str, str]]:
        """Class and heading of each column."""
        return [
            ("up", "rank"),
            ("t name", "loop"),
            ("t s", "valve"),
            ("t", "cycles by"),
            ("s", "OP lost"),
            ("s", "friction f_S"),
            ("", "probability"),
            ("s", TEST),
            ("s", "period"),
            ("", "amplitude, PV units"),
            *(("", head) for head in HEADS.values() if self.gains),
            *([("", "cost per hour")] if self.costs else []),
            *([("trend", TREND)] if self.earlier else []),
            ("up", "group"),
            ("t wordy", "why not judged"),
        ]

    def cells(self, entry: Entry) -> list[tuple[str, str]]:
        """Return what each column shows of a loop, and what it is sorted by."""
        cycle, why = entry.oscillation, say.cause_words(entry.cause)
        found: list[Cell] = [
            (text(entry.rank or ""), entry.rank),
            (_name(entry), entry.name),
            (f'<span class="{kind_of(entry)}">{text(kind_of(entry))}</span>', kind_of(entry)),
            (text(why), why),
            (say.percent(entry.band_share) if entry.found else "", entry.band_share),
            (_friction(entry), entry.f_s if entry.found else None),
            (probability(entry.probability), entry.probability),
            _test(entry),
            _figure(None if cycle is None else cycle.period, say.period),
            _figure(None if cycle is None else cycle.amplitude, say.figure),
            *(_saved(entry, what) for what in HEADS if self.gains),
            *([_figure(entry.cost_per_hour, say.figure)] if self.costs else []),
            *([self._trend(entry)] if self.earlier else []),
            (text(entry.group or ""), entry.group),
            (text(entry.reason), entry.reason),
        ]
        return [
            (shown or _dash(label, entry), _value(value))
            for (_, label), (shown, value) in zip(self.heads, found, strict=True)
        ]

    def _trend(self, entry: Entry) -> Cell:
        trend = self.trends.get(entry.name)
        if trend is None:
            return "", None
        line = trend.line(self.widest[entry.op_unit])
        return f'<span title="{text(trend.told)}">{text(trend.words)} {line}</span>', trend.change


def _figure(value: float | None, words: Callable[[float | None], str]) -> Cell:
    return words(value), value


def _name(entry: Entry) -> str:
    name = "<wbr>".join(text(part) for part in re.split(r"(?<=[_.:/])", entry.name))
    return f'<a href="{text(entry.report)}">{name}</a>' if entry.report else name


def _friction(entry: Entry) -> str:
    if not entry.found:
        return ""
    between, shown = say.interval(entry.f_s_interval), say.op_figure(entry.f_s, entry.op_unit)
    return f'<span title="{text(between)}">{text(shown)}</span>'


def _test(entry: Entry) -> Cell:
    if entry.test is None:
        return "", None
    time, move = entry.test["duration"], entry.test["pv_move"]
    return text(f"{say.period(time)}{'' if move is None else f', PV ±{say.figure(move)}'}"), time


def _saved(entry: Entry, what: str) -> Cell:
    shown, note = in_words(entry, what), note_of(entry, what)
    if not shown:
        return "", None
    whole = text(shown).replace(" %", "&nbsp;%")
    return f'<span title="{text(note)}">{whole}</span>', change(entry, what)


def _dash(label: str, entry: Entry) -> str:
    """Return an empty cell, which says why it is empty."""
    why = NONE.get(label, "")
    if not why:
        healthy = entry.verdict == "healthy"
        why = "The valve is healthy." if healthy else "It is not decided whether the valve sticks."
    if entry.status is not Status.OK and label != "why not judged":
        why = "The loop was not judged."
    return f'<span role="img" aria-label="{why}" title="{why}">–</span>'


def _value(value: object) -> str:
    return "" if value is None else f"{value:.9g}" if isinstance(value, float) else str(value)
