"""The list of a survey on the console."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from stiction_ros.texts import probability

if TYPE_CHECKING:
    from stiction_ros.survey.entry import Entry
    from stiction_ros.survey.pages.trend import Earlier
    from stiction_ros.survey.survey import Survey

SHOWN = 30  # rows of the list that are printed
ALWAYS, CAUSE = 3, 6  # columns that are always there, and the first that is broken between words
APART = 2  # blanks between two columns


def print_list(found: "Survey", earlier: "Sequence[Earlier]") -> None:
    """Print the first rows, in the words of the page; ``earlier`` surveys begin with the oldest."""
    from stiction_ros.survey.listing.headline import changed, headline, worked
    from stiction_ros.survey.pages.words import period

    entries = found.entries[:SHOWN]
    console = Console()
    console.print(_table(entries, console.width))
    for entry in entries:
        if entry.reason:
            console.print(f"{entry.name}: {entry.reason}", highlight=False, markup=False)
    if len(found.entries) > SHOWN:
        console.print(f"and {len(found.entries) - SHOWN} more")
    for group in found.groups:
        names = ", ".join(group.names)
        console.print(f"group {group.number}, period {period(group.period)}: {names}")
    for line in changed(found.entries, earlier):
        console.print(line)
    console.print(headline(found), highlight=False)
    console.print(worked(found))


def _table(entries: "Sequence[Entry]", width: int) -> Table:
    """Return the columns that fit, the most telling first; no word of them is broken."""
    from stiction_ros.survey.listing.headline import kind_of
    from stiction_ros.survey.listing.saved import HEADS, in_words
    from stiction_ros.survey.pages.words import cause_words, op_figure, percent

    rows = [
        (
            str(entry.rank),
            entry.name,
            kind_of(entry),
            op_figure(entry.f_s, entry.op_unit) if entry.found else "",
            percent(entry.band_share) if entry.found else "",
            probability(entry.probability),
            cause_words(entry.cause),
            in_words(entry, "service") if entry.gain else "",
        )
        for entry in entries
    ]
    heads = (
        "rank",
        "loop",
        "valve",
        "f_S",
        "OP lost",
        "probability",
        "cycles by",
        HEADS["service"],
    )
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    left, kept = width, list[int]()
    for place, (head, *cells) in enumerate(zip(heads, *rows, strict=True)):
        whole = place < CAUSE
        words = [*head.split(), *(word for cell in cells for word in cell.split())]
        longest = max(map(len, [*head.split(), *cells] if whole else words))
        if any(cells) and (place < ALWAYS or left >= longest + APART):
            table.add_column(head, min_width=longest, no_wrap=whole, overflow="fold")
            left -= longest + APART
            kept.append(place)
    for row in rows:
        table.add_row(*(row[place] for place in kept))
    return table
