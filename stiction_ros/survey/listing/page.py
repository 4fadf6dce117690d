"""The ranked list on one page."""

from collections.abc import Sequence
from importlib import resources

from stiction_ros.pages.frame import framed, text, words
from stiction_ros.report.page import Cell, card, table
from stiction_ros.survey.entry import Entry
from stiction_ros.survey.listing.columns import COST, Column, columns_of
from stiction_ros.survey.listing.headline import Earlier, changed, headline, kind_of, worked
from stiction_ros.survey.pages.words import cause_words
from stiction_ros.survey.survey import Survey
from stiction_ros.texts import spoken

SCRIPT = resources.files("stiction_ros.survey.listing").joinpath("page.js").read_text("utf-8")


def list_page(survey: Survey, earlier: Sequence[Earlier] = ()) -> str:
    """Return the page of a survey, with those before it, the oldest first."""
    entries = survey.entries
    first = headline(survey)
    columns = columns_of(entries, earlier)
    parts = [
        f"<h1>{text(first)}</h1>",
        f'<p class="soft">{text(_how(survey))}</p>',
        *[f'<p class="note">{text(line)}</p>' for line in changed(entries, earlier)],
        f'<div class="cards">{_counts(entries)}</div>',
        _tools(entries),
        _table(entries, columns),
        _groups(survey),
        _legend(columns),
    ]
    return framed(f"Survey: {first}", parts, SCRIPT, full=True)


def _how(survey: Survey) -> str:
    date = f"{survey.date}. " if survey.date else ""
    return (
        f"{date}{worked(survey)} by {survey.workers} worker{'s' * (survey.workers != 1)} "
        f"({survey.engine})."
    )


def _counts(entries: Sequence[Entry]) -> str:
    kinds = ("sticky", "backlash", "undecided", "healthy", "skipped", "failed")
    counts = {kind: sum(kind_of(entry) == kind for entry in entries) for kind in kinds}
    return "".join(card("", kind, str(count)) for kind, count in counts.items() if count)


def _tools(entries: Sequence[Entry]) -> str:
    kinds = list(dict.fromkeys(kind_of(entry) for entry in entries))
    options = [
        f'<option value="{text(cause)}">{text(cause_words(cause))}</option>'
        for cause in sorted({entry.cause for entry in entries if entry.cause})
    ]
    return (
        '<div class="tools"><input id="search" type="search" placeholder="Search tags and reasons" '
        'aria-label="Search tags and reasons">'
        f'<select id="kind" aria-label="Verdict"><option value="">all verdicts</option>'
        f"{''.join(f'<option>{text(kind)}</option>' for kind in kinds)}</select>"
        f'<select id="cause" aria-label="Cause"><option value="">all causes</option>'
        f"{''.join(options)}</select>"
        f'<span id="shown" class="soft" role="status">{len(entries)} loops</span></div>'
    )


def _table(entries: Sequence[Entry], columns: Sequence[Column]) -> str:
    head = [
        f'<th class="{column.kind}" scope="col"><button type="button" title="{text(column.hint)}">'
        f"{words(column.head)}</button></th>"
        for column in columns
    ]
    rows = []
    for entry in entries:
        cells = []
        for column in columns:
            shown, value = column.shown(entry)
            said = text(column.head.replace("_S", "ₛ"))
            tag = 'th scope="row"' if column.head == "loop" else f'td data-label="{said}"'
            kind = column.kind + " none" * (shown == "–")
            cells.append(f'<{tag} class="{kind}" data-value="{text(value)}">{shown}</{tag[:2]}>')
        rows.append(
            f'<tr data-kind="{text(kind_of(entry))}" data-cause="{text(entry.cause or "")}">'
            f"{''.join(cells)}</tr>"
        )
    if not rows:
        return '<p class="note">There is no loop in what was given.</p>'
    return (
        '<table class="list"><caption class="hidden">Loops, first the valves to service first. '
        "A heading sorts the list.</caption>"
        f"<thead><tr>{''.join(head)}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


def _groups(survey: Survey) -> str:
    if not survey.groups:
        return ""
    rows: list[list[Cell]] = [
        [group.names[0], ", ".join(group.names[1:]), str(group.number), spoken(group.period)]
        for group in survey.groups
    ]
    return (
        "<h2>Loops that cycle together</h2><p>They keep the same time; the likely source comes "
        "first.</p>" + table(("likely source", "with it", "group", "period"), rows, texts=2)
    )


def _legend(columns: Sequence[Column]) -> str:
    costs = any(column.head == COST for column in columns)
    money = " A cost that was given counts too." if costs else ""
    hints = "".join(
        f"<dt>{words(column.head)}</dt><dd>{words(column.hint)}</dd>" for column in columns
    )
    return (
        "<h2>How to read it</h2><p>Valves that stick or have backlash and make their loop cycle "
        "come first; at the top stand the surest whose friction makes most of the loop's "
        "movement. Undecided valves follow in the order of their probability of friction."
        f"{money} The page of a loop has all figures with their intervals.</p><dl>{hints}</dl>"
    )
