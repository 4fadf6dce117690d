"""The ranked list on one page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from stiction_ros import __version__
from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.pages.frame import card, framed, text
from stiction_ros.survey.pages.plot import spark
from stiction_ros.survey.pages.words import CAUSES, figure, interval, percent, period
from stiction_ros.survey.survey import Survey

SCRIPT = """
const rows = [...document.querySelectorAll("table.list tbody tr")];
const body = document.querySelector("table.list tbody");
const search = document.getElementById("search"), kind = document.getElementById("kind");
const cause = document.getElementById("cause"), shown = document.getElementById("shown");
const filter = () => {
  const words = search.value.toLowerCase().split(/\\s+/).filter(word => word);
  let count = 0;
  for (const row of rows) {
    const there = row.textContent.toLowerCase();
    const fits = words.every(word => there.includes(word)) &&
      (!kind.value || row.dataset.kind === kind.value) &&
      (!cause.value || row.dataset.cause === cause.value);
    row.hidden = !fits;
    count += fits;
  }
  shown.textContent = count + " of " + rows.length + " loops";
};
for (const input of [search, kind, cause]) input.addEventListener("input", filter);
const heads = [...document.querySelectorAll("table.list th")];
heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
  const up = head.getAttribute("aria-sort") !== "ascending";
  heads.forEach(other => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", up ? "ascending" : "descending");
  const of = row => row.children[column].dataset.value;
  rows.sort((one, other) => {
    const a = of(one), b = of(other);
    if (a === "" || b === "") return (a === "") - (b === "");
    const order = isNaN(a) || isNaN(b) ? a.localeCompare(b) : a - b;
    return up ? order : -order;
  });
  body.append(...rows);
}));
"""

Trends = Mapping[str, Sequence[float]]
"""Band, f_S + f_D in %, of earlier surveys by loop, the oldest first."""


def list_page(survey: Survey, trends: Trends | None = None) -> str:
    """Return the page.

    Args:
        survey: what was found.
        trends: of earlier surveys; None where none are given.
    """
    entries, trends = survey.entries, trends or {}
    found = [entry for entry in entries if entry.found]
    first = f"{len(found)} valve{'s' * (len(found) != 1)} to look at" if found else "No valve found"
    costs = any(entry.cost_per_hour is not None for entry in entries)
    parts = [
        f"<h1>{text(first)} among {len(entries)} loops</h1>",
        f'<p class="soft">{text(_how(survey))}</p>',
        f'<div class="cards">{_counts(entries)}</div>',
        _tools(entries),
        _table(entries, costs, trends),
        _groups(survey),
        _legend(costs),
    ]
    return framed(f"Survey: {first}", parts, f"stiction_ros {__version__}", SCRIPT)


def _how(survey: Survey) -> str:
    date = f"{survey.date}. " if survey.date else ""
    return (
        f"{date}{len(survey.entries)} loops in {period(survey.seconds)} by {survey.workers} "
        f"worker{'s' * (survey.workers != 1)} ({survey.engine})."
    )


def _kind(entry: Entry) -> str:
    return (entry.verdict or "") if entry.status is Status.OK else entry.status.value


def _counts(entries: Sequence[Entry]) -> str:
    kinds = ("sticky", "backlash", "undecided", "healthy", "skipped", "failed")
    counts = {kind: sum(_kind(entry) == kind for entry in entries) for kind in kinds}
    return "".join(card(kind, str(count)) for kind, count in counts.items() if count)


def _tools(entries: Sequence[Entry]) -> str:
    kinds = list(dict.fromkeys(_kind(entry) for entry in entries))
    causes = sorted({entry.cause for entry in entries if entry.cause})
    return (
        '<div class="tools"><input id="search" type="search" placeholder="Search tags, reasons" '
        'aria-label="Search">'
        f'<select id="kind" aria-label="Verdict"><option value="">all verdicts</option>'
        f"{''.join(f'<option>{text(kind)}</option>' for kind in kinds)}</select>"
        f'<select id="cause" aria-label="Cause"><option value="">all causes</option>'
        f"{''.join(f'<option>{text(cause)}</option>' for cause in causes)}</select>"
        f'<span id="shown" class="soft" role="status">{len(entries)} loops</span></div>'
    )


Column = tuple[str, str, str, object]
"""Class, label, HTML and what it is sorted by."""


def _table(entries: Sequence[Entry], costs: bool, trends: Trends) -> str:
    rows = []
    head: list[str] = []
    for entry in entries:
        columns = _columns(entry, costs, trends)
        if not head:
            head = [
                f'<th class="{kind}"><button type="button">{text(label)}</button></th>'
                for kind, label, _, _ in columns
            ]
        cells = "".join(
            f'<td class="{kind}" data-label="{text(label)}" data-value="{text(_value(value))}">'
            f"{shown}</td>"
            for kind, label, shown, value in columns
        )
        rows.append(
            f'<tr data-kind="{text(_kind(entry))}" data-cause="{text(entry.cause or "")}">'
            f"{cells}</tr>"
        )
    if not rows:
        return '<p class="note">There is no loop in what was given.</p>'
    return (
        f'<table class="list"><thead><tr>{"".join(head)}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _value(value: object) -> object:
    return "" if value is None else f"{value:.9g}" if isinstance(value, float) else value


def _columns(entry: Entry, costs: bool, trends: Trends) -> list[Column]:
    cycle, gain = entry.oscillation, entry.gain or {}
    name = text(entry.name)
    if entry.report:
        name = f'<a href="{text(entry.report)}">{name}</a>'
    kind = _kind(entry)
    found = entry.found
    why = CAUSES.get(entry.cause or "none", "")
    amplitude = None if cycle is None else cycle.amplitude
    beat = None if cycle is None else cycle.period
    columns: list[Column] = [
        ("rank", "rank", text(entry.rank or ""), entry.rank),
        ("t name", "loop", name, entry.name),
        ("t s", "verdict", f'<span class="{kind}">{text(kind)}</span>', kind),
        ("t", "cycles by", text(why), why),
        ("", "band of OP", percent(entry.band_share) if found else "", entry.band_share),
        ("", "f_S %", _friction(entry), entry.f_s if found else None),
        ("", "confidence", percent(entry.confidence), entry.confidence),
        ("s", "period", period(beat), beat),
        ("", "amplitude", figure(amplitude), amplitude),
        ("", "after service", *_share(gain, "service")),
        ("", "embedding", *_share(gain, "embedding")),
        ("", "retuned", *_share(gain, "retune")),
    ]
    if costs:
        columns.append(("", "cost/h", figure(entry.cost_per_hour), entry.cost_per_hour))
    if trends:
        columns.append(("", "band before", *_trend(entry, trends)))
    columns.append(("", "group", text(entry.group or ""), entry.group))
    columns.append(("t wordy", "reason", text(entry.reason), entry.reason))
    return columns


def _friction(entry: Entry) -> str:
    if not entry.found:
        return ""
    return f'<span title="{text(interval(entry.f_s_interval))}">{figure(entry.f_s)}</span>'


def _share(gain: Mapping[str, object], what: str) -> tuple[str, float | None]:
    """Return IAE under an option over that of now."""
    now, option = gain.get("now"), gain.get(what)
    if not isinstance(now, Mapping) or not isinstance(option, Mapping):
        return "", None
    before, after = now.get("iae_per_hour"), option.get("iae_per_hour")
    if not before or after is None:
        return "", None
    return percent(after / before), float(after / before)


def _trend(entry: Entry, trends: Trends) -> tuple[str, float | None]:
    past = trends.get(entry.name)
    if not past:
        return "", None
    now = [] if entry.f_s is None or entry.f_d is None else [entry.f_s + entry.f_d]
    values = [*past, *now]
    return spark(values), values[-1] - values[0]


def _groups(survey: Survey) -> str:
    if not survey.groups:
        return ""
    pages = {entry.name: entry.report for entry in survey.entries}

    def named(name: str) -> str:
        page = pages.get(name)
        return f'<a href="{text(page)}">{text(name)}</a>' if page else text(name)

    rows = "".join(
        f"<tr><td>{group.number}</td><td>{text(period(group.period))}</td>"
        f"<td class='t'>{named(group.names[0])}</td>"
        f"<td class='t'>{', '.join(named(name) for name in group.names[1:])}</td></tr>"
        for group in survey.groups
    )
    return (
        "<h2>Loops that cycle together</h2><p>They keep the same time; the likely source comes "
        "first.</p><div class='wide'><table><thead><tr><th>group</th><th>period</th>"
        "<th class='t'>likely source</th><th class='t'>with it</th></tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )


def _legend(costs: bool) -> str:
    money = " Where a cost was given it weighs in." if costs else ""
    return (
        "<h2>How to read it</h2><p>Valves that stick or have backlash and make their loop cycle "
        "come first, those that are surest and lose most of OP's movement in their band at the "
        "top. Undecided ones follow in the order of what speaks for their friction."
        f"{money} <i>After service</i>, <i>embedding</i> and <i>retuned</i> are what of the "
        "IAE of now is left, simulated; where nothing stands the record does not tell, and the "
        "page of the loop says why. There are all figures with their intervals.</p>"
    )
