"""The frame of every report: one self-contained HTML page without scripts or network."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Template

from stiction_ros import __version__
from stiction_ros.report.drawing import Drawing

_PAGE = Template(
    """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
:root { color-scheme: light dark;
  --paper: #ffffff; --panel: #f6f7f8; --ink: #1d2126; --soft: #5c6670; --line: #dde1e5;
  --bad: #b3470a; --good: #007a59; --open: #6b6f76; }
@media (prefers-color-scheme: dark) { :root {
  --paper: #16191d; --panel: #1f2328; --ink: #e8eaed; --soft: #a3abb4; --line: #343a41;
  --bad: #f0955b; --good: #4cc9a3; --open: #b4b8be; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 40px 28px 72px; }
h1 { font-size: 1.75rem; line-height: 1.25; margin: 0 0 6px; letter-spacing: -0.01em; }
h2 { font-size: 1.2rem; margin: 44px 0 10px; }
h3 { font-size: 1rem; margin: 26px 0 6px; }
p { margin: 8px 0; max-width: 78ch; }
.kicker { color: var(--soft); font-size: 0.9rem; margin: 0 0 18px; }
.lead { font-size: 1.08rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(250px, 1fr)); gap: 14px;
  margin: 22px 0 8px; }
.card { background: var(--panel); border: 1px solid var(--line); border-radius: 10px;
  border-left: 5px solid var(--open); padding: 13px 16px; }
.card.bad { border-left-color: var(--bad); } .card.good { border-left-color: var(--good); }
.card .what { color: var(--soft); font-size: 0.86rem; }
.card .big { font-size: 1.35rem; font-weight: 650; line-height: 1.35; }
.card .more { font-size: 0.9rem; }
.bad .big, td.bad { color: var(--bad); } .good .big, td.good { color: var(--good); }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.92rem; font-variant-numeric: tabular-nums;
  margin: 10px 0; min-width: 60%; }
th, td { padding: 6px 14px 6px 0; border-bottom: 1px solid var(--line); text-align: right;
  vertical-align: baseline; white-space: nowrap; }
th { color: var(--soft); font-weight: 600; border-bottom-width: 2px; }
td.text, th.text { text-align: left; }
td.text { white-space: normal; }
figure { margin: 26px 0; }
figure img { display: block; width: 100%; height: auto; background: #ffffff;
  border: 1px solid var(--line); border-radius: 8px; padding: 10px; }
figcaption { margin-top: 7px; color: var(--soft); font-size: 0.92rem; max-width: 90ch; }
figcaption b { color: var(--ink); }
details { margin: 10px 0; border: 1px solid var(--line); border-radius: 8px; padding: 8px 14px; }
summary { cursor: pointer; }
pre { overflow-x: auto; font-size: 0.82rem; line-height: 1.45; }
sub { font-size: 0.72em; line-height: 0; }
.note { color: var(--soft); font-size: 0.92rem; }
.warn { border-left: 5px solid var(--bad); background: var(--panel); padding: 10px 14px;
  border-radius: 6px; }
footer { margin-top: 56px; color: var(--soft); font-size: 0.85rem; }
@media screen and (prefers-color-scheme: dark) {
  figure img { filter: invert(0.91) hue-rotate(180deg); } }
@media (max-width: 640px) { figure img { width: 640px; } }
@media print { main { padding: 0; max-width: none; } figure { break-inside: avoid; } }
</style>
</head>
<body>
<main>
$body
<footer>$footer</footer>
</main>
</body>
</html>
"""
)

Cell = str | tuple[str, str]
"""Text of a table cell, or its class and its text."""


def page(title: str, parts: Iterable[str]) -> str:
    """Return the whole page."""
    body = "\n".join(part for part in parts if part)
    footer = f"stiction_ros {__version__}"
    return _PAGE.substitute(title=text(title), body=body, footer=footer)


def page_file(out: str | Path) -> tuple[Path, Path | None]:
    """Return the file of a page, and the folder for what stands beside it.

    Args:
        out: a folder, or an ``.html`` file that stands alone; folders are made.

    Returns:
        The file, and the folder; None for a page that stands alone.
    """
    out = Path(out)
    alone = out.suffix.lower() == ".html"
    folder = out.parent if alone else out
    folder.mkdir(parents=True, exist_ok=True)
    return (out, None) if alone else (folder / "report.html", folder)


def text(value: object) -> str:
    """Return ``value`` for HTML."""
    return html.escape(str(value), quote=True)


def words(value: object) -> str:
    """Return ``value`` for HTML with f_S and f_D set as symbols and lines kept."""
    return (
        text(value)
        .replace("f_S", "f<sub>S</sub>")
        .replace("f_D", "f<sub>D</sub>")
        .replace("\n", "<br>")
    )


def count(value: object) -> str:
    """Return a whole number; a dash when there is none."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else "–"


def card(kind: str, what: str, big: str, more: str) -> str:
    """Return a box with one result; ``kind`` is bad, good or open."""
    return (
        f'<div class="card {kind}"><div class="what">{text(what)}</div>'
        f'<div class="big">{text(big)}</div><div class="more">{words(more)}</div></div>'
    )


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]], texts: int = 1) -> str:
    """Return a table; the first ``texts`` columns hold words, the others figures."""
    lines = ['<div class="scroll"><table><tr>']
    for column, title in enumerate(head):
        lines.append(f"<th{_kind('text' if column < texts else '')}>{words(title)}</th>")
    lines.append("</tr>")
    for row in rows:
        lines.append("<tr>")
        for column, cell in enumerate(row):
            kind, value = cell if isinstance(cell, tuple) else ("", cell)
            if column < texts:
                kind = f"text {kind}".strip()
            lines.append(f"<td{_kind(kind)}>{words(value)}</td>")
        lines.append("</tr>")
    return "".join([*lines, "</table></div>"])


def embedded(drawing: Drawing) -> str:
    """Return a figure with its picture inside the page."""
    data = base64.b64encode(drawing.png).decode("ascii")
    return (
        f'<figure id="{text(drawing.name)}"><div class="scroll"><img alt="{text(drawing.title)}" '
        f'src="data:image/png;base64,{data}"></div><figcaption><b>{text(drawing.title)}.</b> '
        f"{text(drawing.caption)}</figcaption></figure>"
    )


def folded(title: str, content: str) -> str:
    """Return preformatted text that opens on a click."""
    return f"<details><summary>{text(title)}</summary><pre>{text(content.rstrip())}</pre></details>"


def number(value: object, digits: int = 3) -> str:
    """Return a figure with ``digits`` significant digits, whole ones whole; else a dash."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    if value == round(value) and abs(value) < 1e6:
        return f"{value:.0f}".replace("-", "−")
    if not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{decimals}f}".replace("-", "−")


def percent(value: object) -> str:
    """Return a friction in % of travel with two decimals; a dash when there is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    return f"{value:.2f}"


def interval(ends: object) -> str:
    """Return ``7.88 … 7.93``; a dash when there is none."""
    if not isinstance(ends, list | tuple) or len(ends) != 2:
        return "–"
    return f"{percent(ends[0])} … {percent(ends[1])}"


def duration(seconds: float | None) -> str:
    """Return a time for people: ``12 h 28 min``, ``45 min 54 s``, ``12.0 s``."""
    if seconds is None or not math.isfinite(seconds):
        return "–"
    whole = round(seconds)
    if whole >= 3600:
        return f"{whole // 3600} h {whole % 3600 // 60} min"
    if whole >= 120:
        return f"{whole // 60} min {whole % 60} s" if whole % 60 else f"{whole // 60} min"
    return f"{seconds:.1f} s"


def _kind(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
