"""What a survey found in a sentence or two, alike on page and console."""

from collections.abc import Sequence

from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.pages.trend import Earlier, new_and_gone
from stiction_ros.survey.pages.words import period
from stiction_ros.survey.survey import Survey

NAMED = 8  # loops that a sentence lists


def headline(survey: Survey) -> str:
    """Return how many valves are to be looked at, or that none could be judged."""
    count, judged = len(survey.entries), survey.judged
    found = sum(entry.found for entry in survey.entries)
    if count and not judged:
        return f"{count} of {count} could not be judged"
    first = f"{found} valve{'s' * (found != 1)} to look at" if found else "No valve found"
    rest = f"; {count - judged} could not be judged" if judged < count else ""
    return f"{first} among {loops(count)}{rest}"


def worked(survey: Survey) -> str:
    """Return how many loops were done in which time, and how many of them were done before."""
    count, seconds = len(survey.entries), period(survey.seconds)
    if not survey.before:
        return f"{loops(count)} in {seconds}"
    here = count - survey.before
    return f"{loops(count)}, {here} of them in this run in {seconds} and {survey.before} before"


def changed(entries: Sequence[Entry], earlier: Sequence[Earlier]) -> list[str]:
    """Return which loops are new and which are gone since the last survey, a sentence each."""
    new, gone = new_and_gone(entries, earlier)
    when = f" the survey of {earlier[-1].day}" if earlier and earlier[-1].date else " the last one"
    told = [f"New since{when}: {_listed(new)}."] if new else []
    return told + ([f"Gone since{when}: {_listed(gone)}."] if gone else [])


def kind_of(entry: Entry) -> str:
    """Return the verdict of a loop that was judged, the status of another one."""
    return (entry.verdict or "") if entry.status is Status.OK else entry.status.value


def loops(count: int) -> str:
    """Return a number of loops in words."""
    return f"{count} loop{'s' * (count != 1)}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more
