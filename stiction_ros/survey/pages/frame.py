"""The frame of every page: style and the few lines of script, nothing fetched."""

from __future__ import annotations

import html
from collections.abc import Iterable
from string import Template

STYLE = """
:root { color-scheme: light dark; --paper: #fff; --panel: #f5f6f8; --ink: #1c2025;
  --soft: #56606b; --line: #d9dee3; --bad: #a8400a; --good: #00704f; --open: #6b6f76;
  --pv: #0067a5; --op: #b35c00; --stem: #00755a; --sp: #6d4b8d; --free: #b04a78; }
@media (prefers-color-scheme: dark) { :root { --paper: #15181c; --panel: #1e2227; --ink: #e8eaed;
  --soft: #a6aeb7; --line: #363c44; --bad: #f3a06c; --good: #55cfab; --open: #b4b8be;
  --pv: #6db8ec; --op: #f0a848; --stem: #4fd0a8; --sp: #c3a2e4; --free: #eb9cc0; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1600px; margin: 0 auto; padding: 28px 20px 60px; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 4px; }
h2 { font-size: 1.15rem; margin: 34px 0 8px; }
p { margin: 8px 0; max-width: 80ch; overflow-wrap: anywhere; }
a { color: var(--pv); }
.soft, footer { color: var(--soft); font-size: .9rem; }
footer { margin-top: 44px; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 10px;
  margin: 16px 0; }
.card { background: var(--panel); border: 1px solid var(--line); border-radius: 8px;
  padding: 9px 13px; }
.card b { display: block; font-size: 1.25rem; }
.tools { display: flex; flex-wrap: wrap; gap: 8px 10px; margin: 14px 0; align-items: center; }
.tools input, .tools select { font: inherit; color: inherit; background: var(--panel);
  border: 1px solid var(--line); border-radius: 7px; padding: 6px 9px; max-width: 100%; }
.tools input { flex: 1 1 200px; min-width: 0; }
table { border-collapse: collapse; width: 100%; font-size: .92rem;
  font-variant-numeric: tabular-nums; }
th, td { padding: 6px 10px 6px 0; border-bottom: 1px solid var(--line); text-align: right;
  vertical-align: top; }
th { color: var(--soft); font-weight: 600; vertical-align: bottom; }
th button { font: inherit; color: inherit; background: none; border: 0; padding: 2px 0;
  cursor: pointer; font-weight: 600; text-align: inherit; }
th[aria-sort=ascending] button::after { content: " ▲"; }
th[aria-sort=descending] button::after { content: " ▼"; }
td.t, th.t { text-align: left; }
td.name, td.wordy { overflow-wrap: anywhere; } td.wordy { min-width: 14ch; }
table.list { font-size: .84rem; }
td.name { min-width: 12ch; font-weight: 600; }
td.s, td.trend { white-space: nowrap; }
.sticky, .backlash, .failed { color: var(--bad); font-weight: 600; }
.healthy { color: var(--good); } .undecided, .skipped { color: var(--open); }
.note { border-left: 4px solid var(--open); background: var(--panel); padding: 8px 12px;
  border-radius: 5px; }
.note.warn { border-left-color: var(--bad); }
figure { margin: 18px 0; } figcaption { color: var(--soft); font-size: .9rem; margin-top: 4px; }
figure.plot { position: relative; }
.plot svg { display: block; width: 100%; height: auto; touch-action: pan-y; overflow: hidden; }
.plot text { fill: var(--soft); font-size: 12px; }
.plot .frame { fill: none; stroke: var(--line); }
.plot .grid { stroke: var(--line); stroke-width: 1; }
.plot polyline { fill: none; stroke-width: 1.3; vector-effect: non-scaling-stroke; }
.plot .pv { stroke: var(--pv); } .plot .op { stroke: var(--op); }
.plot .stem { stroke: var(--stem); } .plot .sp { stroke: var(--sp); stroke-dasharray: 5 3; }
.plot .free { stroke: var(--free); } .plot .diagonal { stroke: var(--soft);
  stroke-dasharray: 4 4; }
.key { display: flex; flex-wrap: wrap; gap: 3px 16px; font-size: .9rem; margin: 2px 0; }
.key i { display: inline-block; width: 20px; border-top: 3px solid; margin: 0 6px 4px 0; }
.key .pv { border-color: var(--pv); } .key .op { border-color: var(--op); }
.key .stem { border-color: var(--stem); } .key .sp { border-color: var(--sp); }
.key .free { border-color: var(--free); }
svg.spark { width: 92px; height: 22px; vertical-align: middle; }
table.list td.trend svg { display: block; margin-left: auto; }
svg.spark polyline { fill: none; stroke: var(--stem); stroke-width: 1.5; }
.plot button { position: absolute; right: 0; top: 0; font: inherit; font-size: .82rem;
  color: var(--ink); background: var(--panel); border: 1px solid var(--line);
  border-radius: 6px; padding: 2px 8px; }
.wide { overflow-x: auto; }
@media (max-width: 760px) {
  main { padding: 18px 14px 44px; }
  table.list thead { display: none; }
  table.list, table.list tbody { display: block; } table.list { font-size: .92rem; }
  table.list tr { display: grid; grid-template-columns: 1fr 1fr; gap: 0 14px; padding: 9px 0;
    border-bottom: 1px solid var(--line); }
  table.list tr[hidden] { display: none; }
  table.list td { border: 0; padding: 2px 0; text-align: left; min-width: 0; }
  table.list td:not(.name):not(:empty)::before { content: attr(data-label) " ";
    color: var(--soft); font-weight: 400; }
  table.list td:empty { display: none; }
  table.list td.name, table.list td.wordy, table.list td.trend { grid-column: 1 / -1; }
  table.list td.wordy::before { content: none; }
  table.list td.trend svg { display: inline-block; margin-left: 6px; }
  .plot[data-low] text { font-size: 24px; }
  table.list td.rank { order: 1; } table.list td { order: 2; } table.list td.name { order: 0; }
}
@media print { :root { color-scheme: light; } main { max-width: none; padding: 0; }
  .tools, .plot button { display: none; } tr, figure { break-inside: avoid; }
  thead { display: table-header-group; } a { color: inherit; text-decoration: none; } }
"""

_PAGE = Template(
    """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>$title</title>
<style>$style</style>
</head>
<body>
<main>
$body
<footer>$footer</footer>
</main>
<script>$script</script>
</body>
</html>
"""
)


def framed(title: str, parts: Iterable[str], footer: str, script: str = "") -> str:
    """Return a whole page; ``parts`` are HTML, ``title`` and ``footer`` are words."""
    body = "\n".join(part for part in parts if part)
    return _PAGE.substitute(
        title=text(title), style=STYLE, body=body, footer=text(footer), script=script
    )


def text(value: object) -> str:
    """Return ``value`` for HTML."""
    return html.escape(str(value), quote=True)


def card(what: str, big: str) -> str:
    """Return a box with one figure."""
    return marked_card(what, text(big))


def marked_card(what: str, big: str) -> str:
    """Return a box with one figure that is HTML."""
    return f'<div class="card"><b>{big}</b>{text(what)}</div>'
