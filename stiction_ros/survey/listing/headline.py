"""What a survey found in a sentence or two, alike on page and console, beside earlier ones."""

import dataclasses
from collections.abc import Mapping, Sequence

from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.pages.words import signed_percent
from stiction_ros.survey.survey import Survey
from stiction_ros.texts import plural, spoken

NAMED = 8  # loops that a sentence lists
HEADS = {
    "service": "|PV−SP| after service",
    "embedding": "|PV−SP| with friction known",
    "retune": "|PV−SP| after retuning",
}
"""Heading of each thing that may be done, wherever people read it."""

WHY = (
    ("do not agree", "draws disagree"),
    ("repeat the record", "does not repeat"),
    ("times as fast", "faster than shown"),
    ("Not simulated", "not simulated"),
    ("grows without end", "unstable"),
    ("No other tuning", "none helps"),
    ("another tuning is not looked for", "not looked for"),
    ("Nothing is promised", "valve makes no cycle"),
    ("cannot be set up", "cannot be set up"),
)
"""What a note of ``gain`` says, and that in a word or two; the first that fits."""

NOTHING = -0.005  # change from which up another tuning is none that helps


@dataclasses.dataclass(frozen=True)
class Earlier:
    """An earlier survey: its date, ISO or empty, and f_S + f_D of its loops in the unit of OP."""

    date: str
    bands: Mapping[str, float | None]

    @property
    def day(self) -> str:
        """Return its date without the time of day, or that it is earlier."""
        return self.date[:10] or "earlier"


def steps_of(entry: Entry, earlier: Sequence[Earlier]) -> list[tuple[str, float]]:
    """Return when the band of a loop was how wide, the oldest first; none without earlier ones."""
    steps = [(one.day, band) for one in earlier if (band := one.bands.get(entry.name)) is not None]
    if steps and entry.f_s is not None and entry.f_d is not None:
        steps.append(("now", entry.f_s + entry.f_d))
    return steps


def headline(survey: Survey) -> str:
    """Return how many valves are to be looked at, or that none could be judged."""
    count = len(survey.entries)
    judged = sum(entry.status is Status.OK for entry in survey.entries)
    found = sum(entry.found for entry in survey.entries)
    if count and not judged:
        return f"{count} of {count} could not be judged"
    first = f"{plural(found, 'valve')} to look at" if found else "No valve found"
    rest = f"; {count - judged} could not be judged" if judged < count else ""
    return f"{first} among {plural(count, 'loop')}{rest}"


def worked(survey: Survey) -> str:
    """Return how many loops were done in which time, and how many of them were done before."""
    loops, seconds = plural(len(survey.entries), "loop"), spoken(survey.seconds)
    if not survey.before:
        return f"{loops} in {seconds}"
    here = len(survey.entries) - survey.before
    return f"{loops}, {here} of them in this run in {seconds} and {survey.before} before"


def changed(entries: Sequence[Entry], earlier: Sequence[Earlier]) -> list[str]:
    """Return which loops are new and which are gone since the last survey, a sentence each."""
    if not earlier:
        return []
    now, before = {entry.name for entry in entries}, set(earlier[-1].bands)
    new, gone = sorted(now - before), sorted(before - now)
    when = f" the survey of {earlier[-1].day}" if earlier[-1].date else " the last one"
    told = [f"New since{when}: {_listed(new)}."] if new else []
    return told + ([f"Gone since{when}: {_listed(gone)}."] if gone else [])


def kind_of(entry: Entry) -> str:
    """Return the verdict of a loop that was judged, the status of another one."""
    return (entry.verdict or "") if entry.status is Status.OK else entry.status.value


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def change(entry: Entry, what: str) -> float | None:
    """Return what an option changes of the mean |PV − SP|: −.75 leaves a quarter of it."""
    gain = entry.gain or {}
    before, after = ((gain.get(key) or {}).get("iae_per_hour") for key in ("now", what))
    if not before or after is None:
        return None
    return float(after) / float(before) - 1.0


def in_words(entry: Entry, what: str) -> str:
    """Return the change, or why there is none; nothing for a valve that needs nothing."""
    if not entry.found:
        return ""
    changed, note = change(entry, what), note_of(entry, what)
    if changed is None:
        return _short(note) or "not simulated"
    if what == "retune" and changed >= NOTHING:
        return _short(note) or "none helps"
    return signed_percent(changed)


def note_of(entry: Entry, what: str) -> str:
    """Return what ``gain`` says of an option; empty where it was not asked."""
    return str(((entry.gain or {}).get(what) or {}).get("note", ""))


def _short(note: str) -> str:
    return next((word for said, word in WHY if said in note), "")
