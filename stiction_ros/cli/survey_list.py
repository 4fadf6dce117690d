"""The list of a survey on the console."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from stiction_ros.survey.entry import Entry
    from stiction_ros.survey.pages.trend import Earlier
    from stiction_ros.survey.survey import Survey

SHOWN = 30
"""Rows of the list that are printed."""

WHOLE = ("rank", "loop", "verdict", "f_S")
"""Columns that are not broken in a narrow window."""

LONGEST = 20
"""Letters of a word that is not broken there."""


def print_list(found: Survey, earlier: Sequence[Earlier]) -> None:
    """Print the first rows, in the words of the page.

    Args:
        found: what to print.
        earlier: surveys before it, the oldest first.
    """
    from stiction_ros.survey.listing.headline import changed, headline, worked
    from stiction_ros.survey.pages.words import period

    entries = found.entries[:SHOWN]
    console = Console()
    console.print(_table(entries))
    if len(found.entries) > SHOWN:
        console.print(f"and {len(found.entries) - SHOWN} more")
    for group in found.groups:
        names = ", ".join(group.names)
        console.print(f"group {group.number}, period {period(group.period)}: {names}")
    for line in changed(found.entries, earlier):
        console.print(line)
    console.print(headline(found), highlight=False)
    console.print(worked(found))


def _table(entries: Sequence[Entry]) -> Table:
    from stiction_ros.survey.listing.headline import kind_of
    from stiction_ros.survey.listing.saved import HEADS, in_words
    from stiction_ros.survey.pages.words import cause_words, op_figure, percent

    rows = [
        (
            str(entry.rank),
            entry.name,
            kind_of(entry),
            cause_words(entry.cause),
            percent(entry.band_share) if entry.found else "",
            op_figure(entry.f_s, entry.op_unit) if entry.found else "",
            percent(entry.probability),
            in_words(entry, "service") if entry.gain else "",
            entry.reason,
        )
        for entry in entries
    ]
    heads = (
        *("rank", "loop", "verdict", "cycles by", "band of OP", "f_S", "probability"),
        *(HEADS["service"], "reason"),
    )
    kept = [place for place in range(len(heads)) if any(row[place] for row in rows)]
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for place in kept:
        whole = heads[place] in WHOLE
        cells = [row[place] for row in rows]
        words = cells if whole else [word for cell in cells for word in cell.split()]
        longest = min(max(map(len, words)), LONGEST)
        table.add_column(heads[place], no_wrap=whole, min_width=longest, overflow="fold")
    for row in rows:
        table.add_row(*(row[place] for place in kept))
    return table
